// Memory of a program that uses OpenCL itself; the lower half of Context::adopt(). Every function throws Error(usage),
// naming `what`, if the memory is not as required.
#pragma once
#include <cstddef>
#include <memory>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Wraps the program's buffer, which must have at least `bytes` bytes, and keeps it alive.
std::shared_ptr<Block> adopted(Context& ctx, void* buffer, std::size_t bytes, bool to_write, const std::string& what);

// Where a buffer lies: a sub-buffer begins at byte `begin` of the buffer `whole`; any other buffer is its own `whole`.
struct BufferPlace {
  void* whole;
  std::size_t begin;
};
BufferPlace place_of(void* buffer);

// Whether `memory` is an image and not a buffer.
bool is_image(void* memory, const std::string& what);
// Checks that `image` is of this context and can take a picture: two-dimensional, of that size, CL_RGBA with 8 bits.
void check_image(Context& ctx, void* image, long width, long height, const std::string& what);
// Bytes [height][width][4] into such an image, after what is enqueued. Waits until they are there.
void write_image(Context& ctx, void* image, long width, long height, const void* pixels);

}  // namespace vsplat
