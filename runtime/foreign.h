// Memory of a program that has OpenCL of its own, beside what Context::adopt() takes. All throw Error(usage), naming
// `what`, where it is not as it should be.
#pragma once
#include <cstddef>
#include <memory>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Another's buffer of at least so many bytes, kept alive.
std::shared_ptr<Block> adopted(Context& ctx, void* buffer, std::size_t bytes, bool to_write, const std::string& what);

// Where a buffer lies: in itself, or in the one that it is a part of, from that one's byte `begin` on.
struct BufferPlace {
  void* whole;
  std::size_t begin;
};
BufferPlace place_of(void* buffer);

// Whether it is an image rather than a buffer.
bool is_image(void* memory, const std::string& what);
// An image of the context's that takes a picture: two-dimensional, of that size, CL_RGBA in 8 bits.
void check_image(Context& ctx, void* image, long width, long height, const std::string& what);
// Bytes [height][width][4] into such an image, after what is enqueued. Waits until they are there.
void write_image(Context& ctx, void* image, long width, long height, const void* pixels);

}  // namespace vsplat
