// What a context chooses when it is opened: its kernels' flavour, and the limits of its memory.
#pragma once
#include <optional>
#include <string>

#include "runtime/arena.h"
#include "runtime/context_options.h"
#include "runtime/device.h"

namespace vsplat {

// The kernels that are asked for, auto, cpu or gpu: `asked`, or if that is auto, VSPLAT_KERNELS.
std::string asked_kernels(const std::string& asked);
// `name`: from asked_kernels(); for auto, the device's traits decide. `mixed`: in mixed precision, what multiplies.
Flavour choose_flavour(const std::string& name, const DeviceInfo& device, const SwitchedOff& off,
                       std::optional<MatrixUnit> mixed);

// `max_memory_gib`: 0 for what the device reports.
ArenaLimits limits_of(const DeviceInfo& device, double max_memory_gib);

}  // namespace vsplat
