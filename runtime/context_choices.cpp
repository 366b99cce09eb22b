#include "runtime/context_choices.h"

#include <algorithm>
#include <array>
#include <cstdlib>

#include "runtime/fail.h"
#include "runtime/launch_checks.h"
#include "runtime/option.h"
#include "runtime/rounding.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

const char* name_of(Flavour flavour) { return flavour == Flavour::cpu ? "cpu" : "gpu"; }
const char* name_of(Precision precision) { return precision == Precision::fp32 ? "fp32" : "mixed"; }
const char* name_of(MatrixUnit unit) {
  constexpr std::array<const char*, kMatrixUnits.size()> names = {"emulated", "ptx",        "dpas", "wmma",
                                                                  "mfma",     "avx512bf16", "amx"};
  return names.at(static_cast<std::size_t>(unit));
}

namespace {

// A flavour that was requested by name is used or refused, whatever the default would be.
Flavour asked_for(Flavour flavour, const SwitchedOff& off) {
  if (flavour == Flavour::cpu ? off.cpu : off.gpu)
    fail(Status::device,
         "the {} kernels were asked for by name, and a self-test has found them wrong on this device and driver: leave "
         "the choice to the program, or set VSPLAT_SELFTEST=ignore to use them all the same",
         name_of(flavour));
  return flavour;
}

// In mixed precision the unit decides. Emulated units have the gpu kernels, unless the cpu kernels are asked for.
Flavour flavour_of_mixed(const std::string& name, const DeviceInfo& device, const SwitchedOff& off, MatrixUnit unit) {
  const bool cpu = is_of_processor(unit) || (unit == MatrixUnit::emulated && name == "cpu");
  if (name == (cpu ? "gpu" : "cpu"))
    fail(Status::usage, "mixed precision by {} and the {} kernels were asked for, and these do not use it",
         name_of(unit), name);
  if (cpu && device.native_float_width < 4)
    fail(Status::device,
         "mixed precision wants vectors for the cpu kernels, and {} has none: ask for the gpu kernels ({}, "
         "VSPLAT_KERNELS), or take fp32",
         device.name, Option::kernels);
  if (cpu ? off.cpu : off.gpu)
    fail(Status::device,
         "mixed precision wants the {} kernels, and a self-test has found them wrong on {} with this driver: take fp32 "
         "as {}",
         cpu ? "cpu" : "gpu", device.name, Option::precision);
  return cpu ? Flavour::cpu : Flavour::gpu;
}

}  // namespace

std::string asked_kernels(const std::string& asked) {
  std::string name = asked;
  if (name.empty() || name == "auto") {
    const char* env = std::getenv("VSPLAT_KERNELS");
    name = env && *env ? env : "auto";
  }
  if (name != "auto" && name != "cpu" && name != "gpu")
    fail(Status::usage, "kernels are auto, cpu or gpu, not \"{}\" ({}, VSPLAT_KERNELS)", name, Option::kernels);
  return name;
}

Flavour choose_flavour(const std::string& name, const DeviceInfo& device, const SwitchedOff& off,
                       std::optional<MatrixUnit> mixed) {
  if (mixed) return flavour_of_mixed(name, device, off, *mixed);
  if (name == "cpu") return asked_for(Flavour::cpu, off);
  if (name == "gpu") return asked_for(Flavour::gpu, off);
  if (off.cpu || off.gpu) return off.cpu ? Flavour::gpu : Flavour::cpu;
  // Tiling through local memory pays off only if that is dedicated memory.
  return device.type != DeviceType::cpu && device.local_is_fast ? Flavour::gpu
         : device.type == DeviceType::gpu                       ? Flavour::gpu
                                                                : Flavour::cpu;
}

ArenaLimits limits_of(const DeviceInfo& device, double max_memory_gib) {
  ArenaLimits limits;
  limits.align = static_cast<std::size_t>(device.align);
  constexpr double most_gib = 1ull << 32;  // more than any device has; sums of sizes stay within 64 bits
  if (max_memory_gib > 0)
    limits.total = static_cast<std::size_t>(std::min(max_memory_gib, most_gib) * (1ull << 30));
  else if (device.type == DeviceType::cpu)  // a CPU device uses the host's memory
    limits.total = std::min<std::size_t>(device.memory, host_memory_limit());
  else
    limits.total = device.memory;
  if (device.address_bits < 64)
    limits.total = std::min(limits.total, (std::size_t{1} << device.address_bits) - limits.align);
  limits.max_alloc = std::min<std::size_t>(device.max_alloc, limits.total);
  limits.on_host = device.type == DeviceType::cpu;
  if (guard_is_wanted()) {
    if (device.is_pocl && std::strtol(device.driver.c_str(), nullptr, 10) >= 7)
      fail(Status::device,
           "VSPLAT_ARENA=guard: PoCL {} may end the process if red zones are read while tensors are freed",
           device.driver);
    limits.guard = round_up<std::size_t>(256, limits.align);
  }
  return limits;
}

}  // namespace vsplat
