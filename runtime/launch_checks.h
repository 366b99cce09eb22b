// What is looked at after each launch where the environment asks for it: aids for debugging, which cost nothing else.
//
//   VSPLAT_CHECK=nan     Each element that the launch has written (see Written) must not be NaN; infinity passes, since
//                        it is a value that some tensors hold. f32 alone, and new ones are NaN, so that what was never
//                        written is found where it is used. An error names the kernel, the argument, and the first
//                        element that is NaN. An argument that the kernel may write and that the launch does
//                        not mark, or the other way round, is an error as well, where the driver tells.
//   VSPLAT_ARENA=guard   Red zones lie before and behind every tensor (see ArenaLimits::guard). All of them must hold
//                        after the launch what they were filled with. An error names the kernel, the tensor and the
//                        first byte that has changed. The zones are NaN as floats: with VSPLAT_CHECK=nan, too, a kernel
//                        that computes with what it reads beyond a tensor is found. Memory is counted with them.
//
// Both read back after each launch and are slow; they may be had together.
#pragma once
#include <string>
#include <vector>

#include "runtime/arena.h"
#include "runtime/launch.h"
#include "runtime/opencl.h"

namespace vsplat {

// Which of them the environment asks for. Throws Error(usage) at a value that means nothing.
bool nan_check_is_wanted();
bool guard_is_wanted();

// Fails where the kernel's signature and the marks of its arguments disagree.
void check_marks(const cl::Kernel& kernel, const std::string& name, const std::vector<KernelArg>& args);
// Makes a new tensor NaN, if it is f32.
void fill_with_nan(const cl::CommandQueue& queue, const Tensor& tensor);
// Fails where what was written holds NaN.
void check_for_nan(const cl::CommandQueue& queue, const std::string& name, const std::vector<KernelArg>& args);

// Fills the red zones of a piece.
void fill_red_zones(const cl::CommandQueue& queue, const Block& block);
// Fails where one of the arena's red zones has changed.
void check_red_zones(const cl::CommandQueue& queue, const Arena& arena, const std::string& name,
                     const std::vector<KernelArg>& args);

}  // namespace vsplat
