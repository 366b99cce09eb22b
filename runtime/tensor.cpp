#include "runtime/tensor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/fail.h"

namespace vsplat {

std::size_t size_of(Type type) {
  switch (type) {
    case Type::u8:
      return 1;
    case Type::u64:
      return 8;
    case Type::f32:
    case Type::i32:
    case Type::u32:
      return 4;
  }
  return 0;
}

const char* name_of(Type type) {
  switch (type) {
    case Type::u8:
      return "u8";
    case Type::u64:
      return "u64";
    case Type::f32:
      return "f32";
    case Type::i32:
      return "i32";
    case Type::u32:
      return "u32";
  }
  return "?";
}

namespace {

long product(const Shape& shape) {
  long count = 1;
  for (const long size : shape) {
    if (size < 0) fail(Status::internal, "a tensor of shape [{}]", fmt::join(shape, ", "));
    count *= size;
  }
  return count;
}

}  // namespace

Tensor::Tensor(std::shared_ptr<Block> block, Shape shape, Type type)
    : block_(std::move(block)), shape_(std::move(shape)), count_(product(shape_)), type_(type) {}

std::string Tensor::describe() const {
  if (!block_) return "none";
  return fmt::format("{} [{}]", name_of(type_), fmt::join(shape_, ", "));
}

long Tensor::rows() const { return shape_.empty() ? 0 : product(Shape(shape_.begin(), shape_.end() - 1)); }

Tensor Tensor::reshaped(Shape shape) const {
  Tensor out(block_, std::move(shape), type_);
  if (out.count_ != count_) fail(Status::internal, "{} cannot become {}", describe(), out.describe());
  return out;
}

Tensor Tensor::first(long rows) const {
  Shape shape = shape_;
  if (shape.empty() || rows < 0 || rows > shape[0]) fail(Status::internal, "the first {} rows of {}", rows, describe());
  shape[0] = rows;
  return Tensor(block_, std::move(shape), type_);
}

}  // namespace vsplat
