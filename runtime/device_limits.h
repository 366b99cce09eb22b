// What devices claim, lowered on request: what a smaller one would do can be tried on any.
#pragma once
#include <string>

#include "runtime/device.h"

namespace vsplat {

// The least that every kernel fits, in its smallest variant: work-items of a group, bytes of local memory.
constexpr std::size_t kLeastGroup = 64, kLeastLocal = 16 << 10;

// Lowers, and never raises, what `device` claims by `text`, as VSPLAT_LIMITS has it: "group=128,local=16K", see
// runtime/README.md. Error(usage) names what is not understood.
void lower(DeviceInfo& device, const std::string& text);

// Error(device) where kernels cannot run at all in what the device claims, naming both figures.
void refuse_too_small(const DeviceInfo& device);

}  // namespace vsplat
