// Checks after each launch, for debugging. The environment switches them on; without it they cost nothing.
//
//   VSPLAT_CHECK=nan     No element that a launch has written (see Written) may be NaN. Infinity passes, since some
//                        tensors hold it. Only f32 is checked. New f32 tensors are filled with NaN, so the use of an
//                        element that was never written is found. The error names the kernel, the argument and the
//                        first element that is NaN. It is also an error if the launch does not mark an argument that
//                        the kernel may write, or marks one that it may not write, as far as the driver reports it.
//   VSPLAT_ARENA=guard   Every tensor has red zones before and behind it (see ArenaLimits::guard). Their content must
//                        be unchanged after each launch. The error names the kernel, the tensor and the first byte that
//                        has changed. As floats the zones are NaN: together with VSPLAT_CHECK=nan this also finds a
//                        kernel that reads beyond a tensor. Memory plans include the zones.
//
// Both read back memory after each launch and are slow. They can be combined.
#pragma once
#include <string>

#include "runtime/arena.h"
#include "runtime/launch.h"
#include "runtime/opencl.h"

namespace vsplat {

// Whether the environment requests each check. Error(usage) for an invalid value.
bool nan_check_is_wanted();
bool guard_is_wanted();

// Fails if the kernel's signature and the marks of its arguments disagree.
void check_marks(const cl::Kernel& kernel, const std::string& name, KernelArgs args);
// Fills a new tensor with NaN, if it is f32.
void fill_with_nan(const cl::CommandQueue& queue, const Tensor& tensor);
// Fails if a written element is NaN.
void check_for_nan(const cl::CommandQueue& queue, const std::string& name, KernelArgs args);

// Fills the red zones of a piece.
void fill_red_zones(const cl::CommandQueue& queue, const Block& block);
// Fails if one of the arena's red zones has changed.
void check_red_zones(const cl::CommandQueue& queue, const Arena& arena, const std::string& name, KernelArgs args);

}  // namespace vsplat
