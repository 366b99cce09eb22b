#include "runtime/launch_checks.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "runtime/fail.h"

namespace vsplat {

namespace {

bool environment_says(const char* variable, const char* word) {
  const char* value = std::getenv(variable);
  if (!value || !*value) return false;
  if (std::string(value) != word) fail(Status::usage, "{} is \"{}\"; {} or nothing expected", variable, value, word);
  return true;
}

const Tensor* tensor_of(const KernelArg& arg) {
  if (const auto* written = std::get_if<Written>(&arg)) return &written->tensor;
  return std::get_if<Tensor>(&arg);
}

// The indices of element number `element` in a tensor of this shape.
Shape coordinates(const Shape& shape, long element) {
  Shape at(shape.size());
  for (std::size_t i = shape.size(); i-- > 0; element /= shape[i]) at[i] = element % shape[i];
  return at;
}

// Every four bytes are a NaN that no computation produces.
constexpr std::array<unsigned char, 4> zone_bytes{0xa5, 0xa5, 0xc5, 0x7f};

struct RedZone {
  const Block* block;
  std::size_t offset, size;  // bytes, in the slab

  bool is_before() const { return offset < block->offset(); }
};

// The zones adjoin the tensor's bytes, even if its piece is larger.
std::array<RedZone, 2> zones_of(const Block& block) {
  const std::size_t end = block.offset() + block.bytes();
  return {RedZone{&block, block.offset() - block.guard(), block.guard()},
          RedZone{&block, end, block.offset() + block.size() + block.guard() - end}};
}

[[noreturn]] void fail_changed(const RedZone& zone, const unsigned char* found, const std::string& name,
                               KernelArgs args) {
  std::size_t first = 0;
  while (found[first] == zone_bytes[(zone.offset + first) % 4]) ++first;
  std::size_t last = zone.size - 1;
  while (found[last] == zone_bytes[(zone.offset + last) % 4]) --last;
  std::string which = "no argument of it";
  for (std::size_t i = 0; i < args.size(); ++i)
    if (const Tensor* tensor = tensor_of(args[i]); tensor && tensor->block().get() == zone.block)
      which = fmt::format("its argument {}", i);
  const std::string where = zone.is_before() ? fmt::format("{} bytes before it", zone.size - first)
                                             : fmt::format("{} bytes behind its end", first);
  fail(Status::internal, "{}: wrote outside of its tensors: {} ({}, {} bytes) has changed from {} on, {} bytes of them",
       name, zone.block->what(), which, zone.block->bytes(), where, last - first + 1);
}

}  // namespace

bool nan_check_is_wanted() { return environment_says("VSPLAT_CHECK", "nan"); }
bool guard_is_wanted() { return environment_says("VSPLAT_ARENA", "guard"); }

void check_marks(const cl::Kernel& kernel, const std::string& name, KernelArgs args) {
  for (cl_uint i = 0; i < args.size(); ++i) {
    if (!tensor_of(args[i])) continue;
    cl_kernel_arg_type_qualifier qualifier = 0;
    if (clGetKernelArgInfo(kernel(), i, CL_KERNEL_ARG_TYPE_QUALIFIER, sizeof qualifier, &qualifier, nullptr) !=
        CL_SUCCESS)
      return;  // the driver has no information on arguments
    const bool may_write = !(qualifier & CL_KERNEL_ARG_TYPE_CONST);
    if (may_write != std::holds_alternative<Written>(args[i]))
      fail(Status::internal, "{}: argument {} ({}) is {}", name, i, tensor_of(args[i])->describe(),
           may_write ? "no pointer to const and is not given as written()"
                     : "a pointer to const and is given as written()");
  }
}

void fill_with_nan(const cl::CommandQueue& queue, const Tensor& tensor) {
  if (tensor.type() == Type::f32 && tensor.count() > 0)
    queue.enqueueFillBuffer(*tensor.block()->buffer(), std::numeric_limits<float>::quiet_NaN(), 0, tensor.bytes());
}

void check_for_nan(const cl::CommandQueue& queue, const std::string& name, KernelArgs args) {
  for (std::size_t i = 0; i < args.size(); ++i) {
    const auto* out = std::get_if<Written>(&args[i]);
    if (!out || !out->tensor || out->tensor.type() != Type::f32 || out->count == 0) continue;
    const Tensor& tensor = out->tensor;
    if (out->first < 0 || out->count < 0 || out->first + out->count > tensor.count())
      fail(Status::internal, "{}: argument {} is {} and is given with elements [{}, {}) written", name, i,
           tensor.describe(), out->first, out->first + out->count);
    std::vector<float> values(static_cast<std::size_t>(out->count));
    queue.enqueueReadBuffer(*tensor.block()->buffer(), CL_TRUE, static_cast<std::size_t>(out->first) * sizeof(float),
                            values.size() * sizeof(float), values.data());
    const auto is_nan = [](float value) { return std::isnan(value); };
    const auto found = std::find_if(values.begin(), values.end(), is_nan);
    if (found == values.end()) continue;
    const long element = out->first + (found - values.begin());
    fail(Status::internal, "{}: argument {} ({}) is NaN at element {}, which is [{}]; {} of the {} written are", name,
         i, tensor.describe(), element, fmt::join(coordinates(tensor.shape(), element), ", "),
         std::count_if(found, values.end(), is_nan), values.size());
  }
}

void fill_red_zones(const cl::CommandQueue& queue, const Block& block) {
  for (const RedZone& zone : zones_of(block)) {
    std::vector<unsigned char> bytes(zone.size);
    for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = zone_bytes[(zone.offset + i) % 4];
    queue.enqueueWriteBuffer(*block.slab(), CL_TRUE, zone.offset, zone.size, bytes.data());
  }
}

void check_red_zones(const cl::CommandQueue& queue, const Arena& arena, const std::string& name, KernelArgs args) {
  std::vector<RedZone> zones;
  std::size_t total = 0;
  for (const Block* block : arena.guarded())
    for (const RedZone& zone : zones_of(*block)) {
      zones.push_back(zone);
      total += zone.size;
    }
  std::vector<unsigned char> found(total);
  unsigned char* to = found.data();
  for (const RedZone& zone : zones) {
    queue.enqueueReadBuffer(*zone.block->slab(), CL_FALSE, zone.offset, zone.size, to);
    to += zone.size;
  }
  wait_for_all(queue);
  to = found.data();
  for (const RedZone& zone : zones) {
    for (std::size_t i = 0; i < zone.size; ++i)
      if (to[i] != zone_bytes[(zone.offset + i) % 4]) fail_changed(zone, to, name, args);
    to += zone.size;
  }
}

}  // namespace vsplat
