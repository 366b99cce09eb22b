// What a context chooses when it is opened: its kernels' flavour, and the limits of its memory.
#pragma once
#include <string>

#include "runtime/arena.h"
#include "runtime/context_options.h"
#include "runtime/device.h"

namespace vsplat {

// `asked`: auto (VSPLAT_KERNELS, else from the device's traits), cpu or gpu.
Flavour choose_flavour(const std::string& asked, const DeviceInfo& device, const SwitchedOff& off, Precision precision);

// `max_memory_gib`: 0 for what the device reports.
ArenaLimits limits_of(const DeviceInfo& device, double max_memory_gib);

}  // namespace vsplat
