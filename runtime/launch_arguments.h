// A launch on its way to the driver: its range against the device's limits, its arguments, and what profiles tell of
// both.
#pragma once
#include <cstdint>
#include <vector>

#include "runtime/device.h"
#include "runtime/launch.h"
#include "runtime/opencl.h"
#include "runtime/profile/profile_sums.h"

namespace vsplat {

// What a kernel is, by the device's compiler.
struct KernelLimits {
  std::size_t group = 0;  // items of its largest work-group
  std::size_t local = 0;  // bytes of local memory that it declares
};

// The work-items of one work-group; fails where the device cannot run them so, by its claims or by its compiler's.
std::size_t check_range(const KernelId& id, const Range& range, const KernelLimits& kernel, std::size_t local_bytes,
                        const DeviceInfo& device);

// Of local memory, that arguments are.
std::size_t local_bytes_of(const std::vector<KernelArg>& args);

void set_arguments(const cl::Kernel& kernel, const char* name, const std::vector<KernelArg>& args,
                   const DeviceInfo& device);

// The launch's range and the shapes of its tensors, in words and as a number.
ProfileVariant variant_of(const Range& range, const std::vector<KernelArg>& args);
std::uint64_t hash_of(const Range& range, const std::vector<KernelArg>& args);

}  // namespace vsplat
