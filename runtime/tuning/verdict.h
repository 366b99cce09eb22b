// What a self-test found about a device with its driver and these kernels: the features that are not used from then on.
//
//   where   the cache folder (disk_cache.h), an entry for each device, driver and text of all kernels
//   read    by every context that is opened, unless its options say what is switched off, or VSPLAT_SELFTEST=ignore
//   written by a self-test alone
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "runtime/device.h"

namespace vsplat {

// Features that are not used because they are wrong. Each has an alternative, named below, that takes its place.
struct SwitchedOff {
  bool cpu = false, gpu = false;  // a flavour of the kernels; instead: the other one
  bool winograd = false;          // convolutions by Winograd's method; instead: the direct sum
  bool vectors = false;           // vectors of 16 in the cpu flavour; instead: loops, as for compilers that split
                                  // vectors
  bool large_tiles = false;       // the gpu flavour's tiles of 128 x 128; instead: 64 x 64
  bool sub_groups = false;        // the requested smaller sub-group size; instead: the compiler's choice
  bool clblast = false;           // CLBlast where it would be chosen; instead: our own matrix product
  bool tuned = false;             // wrong choices of a table (runtime/tuning/tuning.h); instead: the defaults
  bool mixed = false;             // products of rounded operands (gemm_matrix.h); instead: mixed precision is refused
  bool operator==(const SwitchedOff&) const = default;
  bool any() const { return !(*this == SwitchedOff()); }
};

// Each feature with its name in files and in text.
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
  SwitchedOff off;                        // if unusable: both flavours
  std::string worst;                      // text: the kernel that is wrong, and by how much; empty if ok
  std::string date;                       // of the self-test, "2026-11-23"
  std::vector<std::string> refused = {};  // wrong choices of tables, by the names that tuning.h gives them
  // What the built-in object loses in mixed precision by the device's own matrix units, dB of PSNR. Unset: not
  // measured.
  std::optional<double> mixed_loss = std::nullopt;
};

// Whether the device passed a self-test that found mixed precision as good as fp32: less than 0.02 dB are lost. Not
// with VSPLAT_SELFTEST=ignore.
bool mixed_is_as_good(const DeviceInfo& device);

std::optional<Verdict> remembered_verdict(const DeviceInfo& device);
// Stores the verdict. False if there is no cache.
bool remember(const DeviceInfo& device, const Verdict& verdict);

// What a stored verdict switches off; nothing with VSPLAT_SELFTEST=ignore. Error(device) if nothing usable is left.
SwitchedOff fit_for_use(const DeviceInfo& device);
// The wrong choices of tables; none with VSPLAT_SELFTEST=ignore. No context uses them, whichever table has them.
std::vector<std::string> refused_choices(const DeviceInfo& device);

// SHA-256 of the text of all kernels, as 64 digits.
std::string kernels_hash();

}  // namespace vsplat
