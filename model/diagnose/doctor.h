// Diagnoses why there is no OpenCL device, or the wrong one: what was examined, the faults found, and how to mend each.
#pragma once
#include <string>
#include <vector>

#include "model/diagnose/gpu_files.h"
#include "runtime/files/cache_folders.h"
#include "runtime/files/pocl_files.h"
#include "runtime/system/driver_entries.h"
#include "runtime/system/driver_look.h"
#include "runtime/system/environment_check.h"
#include "runtime/tuning/stored_verdicts.h"

namespace vsplat {

struct Finding {
  std::string kind;   // "library_missing": to be read by programs
  std::string about;  // a file, a variable
  std::string found;  // a sentence that begins with `about`
  std::string mend;   // what to do
};

struct LookedDriver {
  DriverEntry entry;
  SeenDriver seen;  // default if the entry names no library
};

// A device as programs see it through the loader.
struct LookedDevice {
  int index = 0, platform = 0, device = 0;
  std::string platform_name;
  SeenDevice seen;
};

struct Cache {
  CacheFolder folder;
  std::string of;  // "vsplat", "PoCL"
  bool writable = true;
  std::vector<DamagedFile> damaged;
};

// Everything that was examined.
struct Looked {
  OpenClLoader loader;
  DriverEntries entries;
  std::vector<LookedDriver> drivers;  // one for each entry, in their order
  SeenDriver all;                     // seen through the loader
  std::vector<LookedDevice> devices;
  std::vector<InstalledDriver> installed;
  GpuFiles files;
  std::vector<Cache> caches;
  std::vector<StoredVerdict> verdicts;
  std::vector<VariableProblem> variables;
  double seconds = 0;  // time limit of each driver
};

struct Diagnosis {
  Looked looked;
  std::vector<Finding> findings;
};

// Each driver is loaded in a separate process, which may take `seconds`.
Diagnosis diagnose(double seconds);
// The faults among those facts.
std::vector<Finding> findings_of(const Looked& looked);

// As text for people, and as JSON (vsplat/doctor.h documents the fields).
std::string diagnosis_text(const Diagnosis& diagnosis);
std::string diagnosis_json(const Diagnosis& diagnosis);

}  // namespace vsplat
