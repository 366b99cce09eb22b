// What a self-test found of a device with its driver and these kernels: what of them is not used from then on.
//
//   where   the cache's folder (disk_cache.h), an entry for each device, driver and text of all kernels
//   read    by every context that is opened, but where it is told what is switched off, or VSPLAT_SELFTEST=ignore
//   written by a self-test alone
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "runtime/device.h"

namespace vsplat {

// What there is something else for, and is not used. Each is a choice that a context makes by itself otherwise.
struct SwitchedOff {
  bool cpu = false, gpu = false;  // a flavour of the kernels: the other one runs
  bool winograd = false;          // convolutions by Winograd's method: the direct sum
  bool vectors = false;           // of 16 in the cpu flavour: loops, as where compilers take vectors apart
  bool large_tiles = false;       // the gpu flavour's tiles of 128 x 128: those of 64 x 64
  bool sub_groups = false;        // fewer work-items as one, on compilers that can be told: as many as they choose
  bool clblast = false;           // CLBlast where it would be chosen: our own matrix product
  bool tuned = false;             // what a table chose (runtime/tuning/tuning.h) and was wrong: the defaults
  bool mixed = false;             // products of rounded operands (gemm_matrix.h): mixed precision is refused
  bool operator==(const SwitchedOff&) const = default;
  bool any() const { return !(*this == SwitchedOff()); }
};

// Each with its name in files, and in words.
struct SwitchName {
  bool SwitchedOff::*which;
  const char *name, *words;
};
const std::vector<SwitchName>& switch_names();
// "Winograd's convolutions, CLBlast".
std::string in_words(const SwitchedOff& off);

enum class Fitness : int { ok = 1, degraded = 2, unusable = 3 };
const char* name_of(Fitness fitness);

struct Verdict {
  Fitness fitness = Fitness::ok;
  SwitchedOff off;                        // with unusable: both flavours
  std::string worst;                      // the kernel that is wrong, and by how much, in words; empty with ok
  std::string date;                       // of the self-test, "2026-11-23"
  std::vector<std::string> refused = {};  // what tables chose and is wrong, by the names that tuning.h gives them
};

std::optional<Verdict> remembered_verdict(const DeviceInfo& device);
// False where there is no cache to keep it in.
bool remember(const DeviceInfo& device, const Verdict& verdict);

// What was remembered to be switched off, but with VSPLAT_SELFTEST=ignore. Error(device) where that leaves nothing.
SwitchedOff fit_for_use(const DeviceInfo& device);
// What tables chose that is wrong, but with VSPLAT_SELFTEST=ignore. No context takes it, whichever table has it.
std::vector<std::string> refused_choices(const DeviceInfo& device);

// SHA-256 of every kernel's text, as 64 digits.
std::string kernels_hash();

}  // namespace vsplat
