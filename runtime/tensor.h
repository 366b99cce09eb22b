// Device memory with a shape. A Tensor is a handle: copies share the memory, and the last copy returns it to the arena
// at once. This needs no wait: the queue runs in order, so the next owner of the memory writes it after all kernels
// that were launched on it before.
#pragma once
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

enum class Type : std::uint8_t { f32, i32, u32, u64, u8 };
std::size_t size_of(Type type);
const char* name_of(Type type);

class Block;  // a piece of an arena, see arena.h

using Shape = std::vector<long>;

class Tensor {
 public:
  Tensor() = default;  // empty; a null pointer as a kernel's argument
  Tensor(std::shared_ptr<Block> block, Shape shape, Type type);

  const Shape& shape() const { return shape_; }
  long dim(std::size_t i) const { return shape_.at(i); }
  std::size_t rank() const { return shape_.size(); }
  long count() const { return count_; }  // elements
  long rows() const;                     // the product of all sizes but the last; 0 if empty
  std::size_t bytes() const { return static_cast<std::size_t>(count_) * size_of(type_); }
  Type type() const { return type_; }
  std::string describe() const;  // "f32 [4, 1025, 768]"

  // The same memory with another shape of the same count.
  Tensor reshaped(Shape shape) const;
  // The same memory, restricted to the first `rows` of the leading dimension.
  Tensor first(long rows) const;

  explicit operator bool() const { return block_ != nullptr; }
  const std::shared_ptr<Block>& block() const { return block_; }

 private:
  std::shared_ptr<Block> block_;
  Shape shape_;
  long count_ = 0;
  Type type_ = Type::f32;
};

}  // namespace vsplat
