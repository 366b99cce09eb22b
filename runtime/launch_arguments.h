// Prepares a launch for the driver: checks its range against the device's limits, sets its arguments, and describes
// both for profiles.
#pragma once
#include <cstdint>

#include "runtime/device.h"
#include "runtime/launch.h"
#include "runtime/opencl.h"
#include "runtime/profile/profile_sums.h"

namespace vsplat {

// A kernel's limits, as the device's compiler reports them.
struct KernelLimits {
  std::size_t group = 0;  // items of its largest work-group
  std::size_t local = 0;  // bytes of local memory that it declares
};

// Returns the number of work-items of a work-group. Fails if it exceeds the limits of the device, or those that its
// compiler reports for the kernel.
std::size_t check_range(const KernelId& id, const Range& range, const KernelLimits& kernel, std::size_t local_bytes,
                        const DeviceInfo& device);

// Bytes of local memory among the arguments.
std::size_t local_bytes_of(KernelArgs args);

void set_arguments(const cl::Kernel& kernel, const char* name, KernelArgs args, const DeviceInfo& device);

// The launch's range and its tensors' shapes, as text and as a hash.
ProfileVariant variant_of(const Range& range, KernelArgs args);
std::uint64_t hash_of(const Range& range, KernelArgs args);

}  // namespace vsplat
