#include "runtime/launch_arguments.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <climits>

#include "runtime/arena.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// Passes one argument to the kernel.
class Setter {
 public:
  Setter(const cl::Kernel& kernel, const char* name, cl_uint index, std::size_t local_memory)
      : kernel_(kernel), name_(name), index_(index), local_memory_(local_memory) {}

  cl_int operator()(const Tensor& tensor) const {
    const cl_mem mem = tensor ? (*tensor.block()->buffer())() : nullptr;
    return set(sizeof(cl_mem), mem ? &mem : nullptr);
  }
  cl_int operator()(const Written& out) const { return (*this)(out.tensor); }
  cl_int operator()(long value) const {
    if (value < INT_MIN || value > INT_MAX)
      fail(Status::internal, "{}: argument {} is {}, which is no int", name_, index_, value);
    const cl_int narrow = static_cast<cl_int>(value);
    return set(sizeof narrow, &narrow);
  }
  cl_int operator()(unsigned value) const { return set(sizeof value, &value); }
  cl_int operator()(float value) const { return set(sizeof value, &value); }
  cl_int operator()(const Local& local) const {
    if (local.bytes > local_memory_)
      fail(Status::device, "{}: {} bytes of local memory asked for, the device has {}", name_, local.bytes,
           local_memory_);
    return set(local.bytes, nullptr);
  }

 private:
  cl_int set(std::size_t bytes, const void* value) const { return clSetKernelArg(kernel_(), index_, bytes, value); }

  const cl::Kernel& kernel_;
  const char* name_;
  cl_uint index_;
  std::size_t local_memory_;
};

// The tensor in an argument; null if it is none.
const Tensor* tensor_of(const KernelArg& arg) {
  const Tensor* out = std::get_if<Tensor>(&arg);
  if (const Written* written = std::get_if<Written>(&arg)) out = &written->tensor;
  return out && *out ? out : nullptr;
}

}  // namespace

std::size_t check_range(const KernelId& id, const Range& range, const KernelLimits& kernel, std::size_t local_bytes,
                        const DeviceInfo& device) {
  std::size_t group = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t local = range.local[i];
    if (local == 0) continue;
    group *= local;
    if (range.global[i] % local != 0)
      fail(Status::internal, "{}: global size {} is no multiple of local size {} in direction {}", id.name,
           range.global[i], local, i);
  }
  if (group > device.max_work_group)
    fail(Status::device, "{}: work-groups of {} items asked for, the device allows {}", id.name, group,
         device.max_work_group);
  if (group > kernel.group)
    fail(Status::device,
         "{}: work-groups of {} items asked for, the driver runs it in groups of {} at the most; smaller ones run with "
         "VSPLAT_LIMITS=group=128 or 64",
         id.name, group, kernel.group);
  if (kernel.local + local_bytes > device.local_memory)
    fail(Status::device, "{}: {} bytes of local memory needed, the device has {}", id.name, kernel.local + local_bytes,
         device.local_memory);
  return group;
}

std::size_t local_bytes_of(KernelArgs args) {
  std::size_t out = 0;
  for (const KernelArg& arg : args)
    if (const auto* of = std::get_if<Local>(&arg)) out += of->bytes;
  return out;
}

void set_arguments(const cl::Kernel& kernel, const char* name, KernelArgs args, const DeviceInfo& device) {
  const auto expected = kernel.getInfo<CL_KERNEL_NUM_ARGS>();
  if (expected != args.size())
    fail(Status::internal, "{}: {} arguments given, {} expected", name, args.size(), expected);
  for (cl_uint i = 0; i < args.size(); ++i) {
    const cl_int status = std::visit(Setter(kernel, name, i, device.local_memory), args[i]);
    if (status != CL_SUCCESS) fail(Status::internal, "{}: argument {} refused: {}", name, i, cl_error_name(status));
  }
}

ProfileVariant variant_of(const Range& range, KernelArgs args) {
  ProfileVariant out;
  out.global = range.global, out.local = range.local;
  for (const KernelArg& arg : args) {
    const Tensor* tensor = tensor_of(arg);
    if (tensor) out.shapes += fmt::format("{}[{}]", out.shapes.empty() ? "" : " ", fmt::join(tensor->shape(), ", "));
  }
  return out;
}

std::uint64_t hash_of(const Range& range, KernelArgs args) {
  std::uint64_t out = 14695981039346656037u;  // FNV-1a, applied to whole integers
  const auto add = [&](std::uint64_t value) { out = (out ^ value) * 1099511628211u; };
  for (const std::size_t size : range.global) add(size);
  for (const std::size_t size : range.local) add(size);
  for (const KernelArg& arg : args) {
    const Tensor* tensor = tensor_of(arg);
    if (!tensor) continue;
    add(~std::uint64_t{0});
    for (const long size : tensor->shape()) add(static_cast<std::uint64_t>(size));
  }
  return out;
}

}  // namespace vsplat
