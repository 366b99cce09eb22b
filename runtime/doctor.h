// Why there is no OpenCL device, or the wrong one: what is looked at, and what is found wrong, with the mend.
#pragma once
#include <string>
#include <vector>

#include "runtime/files/cache_folders.h"
#include "runtime/files/gpu_files.h"
#include "runtime/files/pocl_files.h"
#include "runtime/system/driver_entries.h"
#include "runtime/system/driver_look.h"
#include "runtime/system/environment_check.h"
#include "runtime/tuning/kept_verdicts.h"

namespace vsplat {

struct Finding {
  std::string kind;   // "library_missing": for programs
  std::string about;  // a file, a variable
  std::string found;  // a sentence that begins with that
  std::string mend;   // what to do
};

struct LookedDriver {
  DriverEntry entry;
  SeenDriver seen;  // nothing where the entry names no library
};

// A device as programs have it, by the loader.
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

// What was looked at.
struct Looked {
  OpenClLoader loader;
  DriverEntries entries;
  std::vector<LookedDriver> drivers;  // of those entries, in their order
  SeenDriver all;                     // what the loader gives
  std::vector<LookedDevice> devices;
  std::vector<InstalledDriver> installed;
  GpuFiles files;
  std::vector<Cache> caches;
  std::vector<KeptVerdict> verdicts;
  std::vector<VariableProblem> variables;
  double seconds = 0;  // that each look might take
};

struct Diagnosis {
  Looked looked;
  std::vector<Finding> findings;
};

// `seconds` is what one driver may take, which is loaded in a process of its own.
Diagnosis diagnose(double seconds);
// What is wrong with that.
std::vector<Finding> findings_of(const Looked& looked);

// For a person, and as JSON (the fields are told in vsplat/doctor.h).
std::string diagnosis_text(const Diagnosis& diagnosis);
std::string diagnosis_json(const Diagnosis& diagnosis);

}  // namespace vsplat
