// Tensors in one piece of memory, one behind the other, and all of it as one tensor: what treats each element alike is
// one launch for all of them.
#pragma once
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

struct SideBySide {
  Tensor whole;               // f32, of one dimension
  std::vector<Tensor> parts;  // of the shapes that were asked for, in their order
};

// All zeros, also what lies between the parts, which begin where the device wants buffers to. Between red zones
// (VSPLAT_ARENA=guard) stands the whole, not each part.
SideBySide side_by_side(Context& ctx, const std::vector<Shape>& shapes, const std::string& what);

// As many parts as fit into `bytes`, at least one: what is longer than a device makes in one piece goes into several.
// The numbers of parts, in order.
std::vector<std::size_t> split_to_fit(const Context& ctx, const std::vector<Shape>& shapes, std::size_t bytes);

}  // namespace vsplat
