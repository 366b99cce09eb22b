// What a launch is made of: the kernel, how many work-items run, and its arguments.
#pragma once
#include <array>
#include <cstddef>
#include <string>
#include <variant>

#include "runtime/tensor.h"

namespace vsplat {

// What one launch costs: floating-point operations, and bytes that must move at the least.
struct Cost {
  double flops = 0;
  double bytes = 0;
  double performed = 0;  // operations of a method that saves some of `flops`; 0: just these
  double most = 0;       // operations at the most, where only the kernel finds out how many; 0: just these
};

// Global and local sizes; a local size of 0 leaves the choice to the driver. A global size of 0 launches nothing.
struct Range {
  std::array<std::size_t, 3> global{1, 1, 1};
  std::array<std::size_t, 3> local{0, 0, 0};
};
// At least n work-items in groups of `local`: kernels guard the tail.
Range items(long n, long local = 64);
// n work-groups (of n2 and n3 in the other directions) of `local` work-items each, in the first direction.
Range groups(long n, long local, long n2 = 1, long n3 = 1);

// A kernel by file and function, with the defines its program is built with ("-DTILE=4 -DSILU").
struct KernelId {
  const char* file;  // "layernorm" for cl/dense/layernorm.cl
  const char* name;
  std::string defines;
  const char* label = nullptr;  // what the profile calls it, if not by its name
  // Of a kernel that can count what it does: operations of one. In a profiled run it is compiled with -DCOUNT and takes
  // two arguments more, numbers of 64 bits and which of them it adds to.
  double flops_per_count = 0;
};

// Local memory as a kernel's argument.
struct Local {
  std::size_t bytes;
};

// A tensor that the kernel writes: every argument is one that the kernel takes as a pointer to what is not const. With
// it goes which of its elements hold values after the launch, by this launch or by one before: VSPLAT_CHECK=nan looks
// at those.
struct Written {
  Tensor tensor;
  long first = 0, count = 0;  // elements; none of them where only the kernel knows which
};
// All of it.
inline Written written(const Tensor& tensor) { return {tensor, 0, tensor.count()}; }
// Its first `count` elements.
inline Written written(const Tensor& tensor, long count) { return {tensor, 0, count}; }
// `count` elements from `first` on.
inline Written written(const Tensor& tensor, long first, long count) { return {tensor, first, count}; }
// Elements that only the kernel knows, or whose bits are no numbers: not looked at.
inline Written written_somewhere(const Tensor& tensor) { return {tensor, 0, 0}; }

// A long is an int on the device; launch() refuses one that is beyond it.
using KernelArg = std::variant<Tensor, Written, long, unsigned, float, Local>;

}  // namespace vsplat
