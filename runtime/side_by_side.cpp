#include "runtime/side_by_side.h"

#include <algorithm>

#include "runtime/arena.h"
#include "runtime/fail.h"
#include "runtime/rounding.h"

namespace vsplat {
namespace {

// Bytes of a part, with the gap after it.
std::size_t padded_bytes(const Context& ctx, const Shape& shape) {
  std::size_t bytes = sizeof(float);
  for (const long size : shape) bytes *= static_cast<std::size_t>(size);
  return round_up(std::max<std::size_t>(bytes, 1), ctx.memory().limits().align);
}

}  // namespace

SideBySide side_by_side(Context& ctx, const std::vector<Shape>& shapes, const std::string& what) {
  std::size_t bytes = 0;
  for (const Shape& shape : shapes) bytes += padded_bytes(ctx, shape);
  SideBySide out;
  out.whole = ctx.tensor({static_cast<long>(bytes / sizeof(float))}, Type::f32, what);
  ctx.fill_zero(out.whole);
  std::size_t first = 0;
  for (const Shape& shape : shapes) {
    const Tensor part(nullptr, shape, Type::f32);
    out.parts.emplace_back(std::make_shared<Block>(out.whole.block(), first, part.bytes()), shape, Type::f32);
    first += padded_bytes(ctx, shape);
  }
  return out;
}

std::vector<std::size_t> split_to_fit(const Context& ctx, const std::vector<Shape>& shapes, std::size_t bytes) {
  std::vector<std::size_t> out;
  std::size_t left = 0;
  for (const Shape& shape : shapes) {
    const std::size_t more = padded_bytes(ctx, shape);
    if (out.empty() || more > left) {
      out.push_back(0);
      left = std::max(bytes, more);
    }
    ++out.back();
    left -= more;
  }
  return out;
}

Tensor slice(const Tensor& whole, long from, long count) {
  if (whole.rank() == 0 || from < 0 || count < 0 || from + count > whole.dim(0))
    fail(Status::internal, "{} rows of {} from {} on", count, whole.describe(), from);
  Shape shape = whole.shape();
  shape[0] = count;
  const Tensor part(nullptr, shape, whole.type());
  const std::size_t before =
      whole.bytes() / static_cast<std::size_t>(std::max(whole.dim(0), 1L)) * static_cast<std::size_t>(from);
  return {std::make_shared<Block>(whole.block(), before, part.bytes()), shape, whole.type()};
}

}  // namespace vsplat
