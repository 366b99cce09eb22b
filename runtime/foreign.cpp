#include "runtime/foreign.h"

#include "runtime/arena.h"
#include "runtime/opencl.h"

namespace vsplat {
namespace {

// Runs an OpenCL query of `memory`, which may not be an OpenCL memory object at all.
template <class F>
auto asked(const std::string& what, const F& ask) {
  try {
    return ask();
  } catch (const cl::Error& e) {
    fail(Status::usage, "{} is no cl_mem that OpenCL knows: {}", what, cl_error_name(e.err()));
  }
}

void check_context(Context& ctx, const cl::Memory& memory, const char* kind, const std::string& what) {
  if (memory.getInfo<CL_MEM_CONTEXT>()() != ctx.handles().context)
    fail(Status::usage, "{} is {} of another cl_context than the device's", what, kind);
}

}  // namespace

std::shared_ptr<Block> adopted(Context& ctx, void* buffer, std::size_t bytes, bool to_write, const std::string& what) {
  return asked(what, [&] {
    auto theirs = std::make_unique<cl::Buffer>(static_cast<cl_mem>(buffer), true);
    if (theirs->getInfo<CL_MEM_TYPE>() != CL_MEM_OBJECT_BUFFER) fail(Status::usage, "{} is no buffer", what);
    check_context(ctx, *theirs, "a buffer", what);
    if (to_write && (theirs->getInfo<CL_MEM_FLAGS>() & CL_MEM_READ_ONLY))
      fail(Status::usage, "{} is to be written, and its buffer was made with CL_MEM_READ_ONLY", what);
    const auto there = theirs->getInfo<CL_MEM_SIZE>();
    if (there < bytes) fail(Status::usage, "{} is a buffer of {} bytes: at least {} expected", what, there, bytes);
    return std::make_shared<Block>(std::move(theirs), bytes);
  });
}

BufferPlace place_of(void* buffer) {
  return asked("a buffer", [&] {
    const cl::Buffer part(static_cast<cl_mem>(buffer), true);
    const cl_mem whole = part.getInfo<CL_MEM_ASSOCIATED_MEMOBJECT>()();
    return whole ? BufferPlace{whole, part.getInfo<CL_MEM_OFFSET>()} : BufferPlace{buffer, 0};
  });
}

bool is_image(void* memory, const std::string& what) {
  return asked(what, [&] {
    return cl::Memory(static_cast<cl_mem>(memory), true).getInfo<CL_MEM_TYPE>() != CL_MEM_OBJECT_BUFFER;
  });
}

void check_image(Context& ctx, void* image, long width, long height, const std::string& what) {
  asked(what, [&] {
    const cl::Image2D theirs(static_cast<cl_mem>(image), true);
    check_context(ctx, theirs, "an image", what);
    if (theirs.getInfo<CL_MEM_TYPE>() != CL_MEM_OBJECT_IMAGE2D)
      fail(Status::usage, "{} is an image of a kind other than CL_MEM_OBJECT_IMAGE2D", what);
    const auto there_width = theirs.getImageInfo<CL_IMAGE_WIDTH>(),
               there_height = theirs.getImageInfo<CL_IMAGE_HEIGHT>();
    if (static_cast<long>(there_width) != width || static_cast<long>(there_height) != height)
      fail(Status::usage, "{} is an image of {} x {} pixels: {} x {} expected", what, there_width, there_height, width,
           height);
    const auto format = theirs.getImageInfo<CL_IMAGE_FORMAT>();
    const bool bytes =
        format.image_channel_data_type == CL_UNORM_INT8 || format.image_channel_data_type == CL_UNSIGNED_INT8;
    if (format.image_channel_order != CL_RGBA || !bytes)
      fail(Status::usage, "{} is an image of a format other than CL_RGBA with CL_UNORM_INT8 or CL_UNSIGNED_INT8", what);
  });
}

void write_image(Context& ctx, void* image, long width, long height, const void* pixels) {
  if (ctx.planning() || width == 0 || height == 0) return;
  try {
    const cl::CommandQueue queue(static_cast<cl_command_queue>(ctx.raw_queue()), true);
    const cl::Image2D to(static_cast<cl_mem>(image), true);
    // The host writes the image, because PoCL 3.1 crashes when a sub-buffer is copied to an image.
    queue.enqueueWriteImage(to, CL_TRUE, {0, 0, 0},
                            {static_cast<std::size_t>(width), static_cast<std::size_t>(height), 1}, 0, 0, pixels);
  } catch (const cl::Error& e) {
    fail_cl(e, "writing a picture to an image");
  }
}

}  // namespace vsplat
