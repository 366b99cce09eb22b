// A context's tensors, and transfers between them and the host.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "runtime/context_impl.h"
#include "runtime/host_span.h"

namespace vsplat {
namespace {

// Up to so many bytes are copied here and written when the device comes to it: a wait for that would leave the device
// idle. At most so many are kept.
constexpr std::size_t kSmallWrite = std::size_t{64} << 10, kMostKept = std::size_t{4} << 20;

}  // namespace

Tensor Context::tensor(const Shape& shape, Type type, const std::string& what) {
  std::size_t bytes = size_of(type);
  for (const long size : shape) bytes *= static_cast<std::size_t>(size);
  std::string where = what;
  if (!impl_->stage.empty()) where += " (stage " + impl_->stage + ")";
  if (impl_->guards) where = fmt::format("{} [{}], {}", name_of(type), fmt::join(shape, ", "), where);
  Tensor out(impl_->arena->allocate(bytes, where), shape, type);
  impl_->note_stage_memory();
  if (impl_->guards && !impl_->planning) fill_red_zones(impl_->queue, *out.block());
  if (impl_->checks_nan && !impl_->planning) fill_with_nan(impl_->queue, out);
  return out;
}

Tensor Context::upload(const Shape& shape, const void* data, Type type, const std::string& what) {
  Tensor out = tensor(shape, type, what);
  write(out, data);
  return out;
}

void Context::write(const Tensor& tensor, const void* data) {
  if (impl_->planning || tensor.count() == 0) return;
  const HostSpan span(HostKind::upload, "write");
  const std::size_t bytes = tensor.bytes();
  const bool waits = bytes > kSmallWrite || impl_->written_bytes + bytes > kMostKept;
  if (!waits) {
    const char* from = static_cast<const char*>(data);
    data = impl_->written.emplace_back(from, from + bytes).data();
    impl_->written_bytes += bytes;
  }
  impl_->transfer("write", static_cast<double>(bytes), [&](cl::Event* event) {
    impl_->queue.enqueueWriteBuffer(*tensor.block()->buffer(), waits ? CL_TRUE : CL_FALSE, 0, bytes, data, nullptr,
                                    event);
  });
  if (waits) impl_->forget_written();
}

void Context::fill_zero(const Tensor& tensor) {
  if (impl_->planning || tensor.count() == 0) return;
  const std::size_t bytes = tensor.bytes();
  impl_->transfer("fill", static_cast<double>(bytes), [&](cl::Event* event) {
    const cl::Buffer& buffer = *tensor.block()->buffer();
    // PoCL stores one pattern after another.
    if (bytes % sizeof(cl_ulong) == 0)
      impl_->queue.enqueueFillBuffer(buffer, cl_ulong{0}, 0, bytes, nullptr, event);
    else
      impl_->queue.enqueueFillBuffer(buffer, cl_uchar{0}, 0, bytes, nullptr, event);
  });
}

void Context::copy(const Tensor& from, const Tensor& to) {
  if (from.bytes() != to.bytes()) fail(Status::internal, "copy of {} to {}", from.describe(), to.describe());
  if (impl_->planning || from.count() == 0) return;
  impl_->transfer("copy", 2.0 * static_cast<double>(from.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueCopyBuffer(*from.block()->buffer(), *to.block()->buffer(), 0, 0, from.bytes(), nullptr, event);
  });
}

void Context::check_element(const Tensor& tensor, std::size_t bytes) {
  if (bytes != size_of(tensor.type()))
    fail(Status::internal, "read of {} as elements of {} bytes", tensor.describe(), bytes);
}

void Context::read(const Tensor& tensor, void* data) {
  if (impl_->planning) fail(Status::internal, "a plan cannot read {}", tensor.describe());
  if (tensor.count() == 0) return;
  const HostSpan span(HostKind::wait, "reading back");
  impl_->transfer("read", static_cast<double>(tensor.bytes()), [&](cl::Event* event) {
    impl_->queue.enqueueReadBuffer(*tensor.block()->buffer(), CL_TRUE, 0, tensor.bytes(), data, nullptr, event);
  });
  impl_->forget_written();
}

}  // namespace vsplat
