// Tensors one after the other in one piece of memory, and the whole piece as one tensor: an elementwise operation needs
// one launch for all of them.
#pragma once
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat {

struct SideBySide {
  Tensor whole;               // f32, of one dimension
  std::vector<Tensor> parts;  // with the requested shapes, in order
};

// Allocates the parts and fills them, and the gaps between them, with zeros. Each part begins at the device's buffer
// alignment. Red zones (VSPLAT_ARENA=guard) enclose the whole, not each part.
SideBySide side_by_side(Context& ctx, const std::vector<Shape>& shapes, const std::string& what);

// Splits a list of parts that is longer than the device's largest buffer: each piece has as many parts as fit into
// `bytes`, at least one. Returns the number of parts of each piece, in order.
std::vector<std::size_t> split_to_fit(const Context& ctx, const std::vector<Shape>& shapes, std::size_t bytes);

// `count` rows of a tensor's leading dimension from `from` on, in the same memory. The bytes before them are a multiple
// of the device's buffer alignment.
Tensor slice(const Tensor& whole, long from, long count);

}  // namespace vsplat
