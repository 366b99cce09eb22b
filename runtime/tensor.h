// Device memory with a shape. A Tensor is a handle: copies share the memory, and the last one gone gives it
// back to the arena at once. The queue runs in order, so whoever gets that memory next writes it after every
// kernel that was launched on it before: no waiting, and buffers are reused as soon as their last reader is enqueued.
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
  Tensor() = default;  // none; as a kernel's argument a null pointer
  Tensor(std::shared_ptr<Block> block, Shape shape, Type type);

  const Shape& shape() const { return shape_; }
  long dim(std::size_t i) const { return shape_.at(i); }
  std::size_t rank() const { return shape_.size(); }
  long count() const { return count_; }  // elements
  long rows() const;                     // the product of all sizes but the last; 0 of none
  std::size_t bytes() const { return static_cast<std::size_t>(count_) * size_of(type_); }
  Type type() const { return type_; }
  std::string describe() const;  // "f32 [4, 1025, 768]"

  // The same memory under another shape of equal count.
  Tensor reshaped(Shape shape) const;
  // The same memory, of which the first `rows` of the leading dimension are meant.
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
