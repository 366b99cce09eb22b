// Lowers the limits that a device reports, so that any device can stand in for a smaller one.
#pragma once
#include <string>

#include "runtime/device.h"

namespace vsplat {

// The minimum in which the smallest variant of every kernel runs: work-items of a group, bytes of local memory.
constexpr std::size_t kLeastGroup = 64, kLeastLocal = 16 << 10;

// Lowers, and never raises, the limits of `device` by `text`, in the format of VSPLAT_LIMITS: "group=128,local=16K",
// see runtime/README.md. Error(usage) names what it does not understand.
void lower(DeviceInfo& device, const std::string& text);

// Error(device) if the limits of the device are too small for any kernel; names the limit and the minimum.
void refuse_too_small(const DeviceInfo& device);

}  // namespace vsplat
