// The parts of a launch: the kernel, its range of work-items, and its arguments.
#pragma once
#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <variant>

#include "runtime/tensor.h"

namespace vsplat {

// The cost of one launch: floating-point operations, and the bytes that it must at least move.
struct Cost {
  double flops = 0;
  double bytes = 0;
  double performed = 0;  // operations that the method in use really performs, if fewer than `flops`; 0: `flops`
  double most = 0;       // upper bound of operations if only the kernel knows how many; 0: `flops`
};

// Global and local sizes. A local size of 0 leaves the choice to the driver. A global size of 0 launches nothing.
struct Range {
  std::array<std::size_t, 3> global{1, 1, 1};
  std::array<std::size_t, 3> local{0, 0, 0};
};
// At least n work-items, in groups of `local`; kernels guard the tail.
Range items(long n, long local = 64);
// n work-groups in the first direction, n2 and n3 in the others. Each has `local` work-items, all in the first
// direction.
Range groups(long n, long local, long n2 = 1, long n3 = 1);

// Names a kernel by file and function, with the defines that its program is built with ("-DTILE=4 -DSILU").
struct KernelId {
  const char* file;  // "layernorm" for cl/dense/layernorm.cl
  const char* name;
  std::string defines;
  const char* label = nullptr;  // name in the profile; null: `name`
  // For a kernel that counts its work: operations for each count. In a profiled run the kernel is compiled with -DCOUNT
  // and takes two more arguments: an array of 64-bit counters, and the index of the one that it adds to.
  double flops_per_count = 0;
};

// Local memory as a kernel's argument.
struct Local {
  std::size_t bytes;
};

// A tensor that the kernel writes. Every argument that the kernel declares as a pointer to non-const is passed in this
// form. It states which elements hold values after the launch, written by this launch or an earlier one:
// VSPLAT_CHECK=nan checks those.
struct Written {
  Tensor tensor;
  long first = 0, count = 0;  // elements; count 0 if only the kernel knows which
};
// The whole tensor.
inline Written written(const Tensor& tensor) { return {tensor, 0, tensor.count()}; }
// Its first `count` elements.
inline Written written(const Tensor& tensor, long count) { return {tensor, 0, count}; }
// `count` elements from `first` on.
inline Written written(const Tensor& tensor, long first, long count) { return {tensor, first, count}; }
// For elements that only the kernel knows, or whose bits are not numbers: they are not checked.
inline Written written_somewhere(const Tensor& tensor) { return {tensor, 0, 0}; }

// A long becomes an int on the device; launch() rejects values that do not fit.
using KernelArg = std::variant<Tensor, Written, long, unsigned, float, Local>;
using KernelArgs = std::span<const KernelArg>;

}  // namespace vsplat
