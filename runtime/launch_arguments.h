// A launch on its way to the driver: its range against the device's limits, its arguments, and what profiles tell of
// both.
#pragma once
#include <cstdint>
#include <vector>

#include "runtime/device.h"
#include "runtime/launch.h"
#include "runtime/opencl.h"
#include "runtime/profile_sums.h"

namespace vsplat {

// The work-items of one work-group; fails where the device cannot run them so.
std::size_t check_range(const KernelId& id, const Range& range, const DeviceInfo& device);

void set_arguments(const cl::Kernel& kernel, const char* name, const std::vector<KernelArg>& args,
                   const DeviceInfo& device);

// The launch's range and the shapes of its tensors, in words and as a number.
ProfileVariant variant_of(const Range& range, const std::vector<KernelArg>& args);
std::uint64_t hash_of(const Range& range, const std::vector<KernelArg>& args);

}  // namespace vsplat
