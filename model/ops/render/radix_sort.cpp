#include "model/ops/render/radix_sort.h"

#include <algorithm>
#include <utility>

#include "model/ops/render/scan.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Keys per block. On a CPU there are just enough blocks to distribute them evenly, since each has a histogram.
long block_size(const Context& ctx, const TunedValues& tuned, long n) {
  if (ctx.flavour() == Flavour::gpu) return tuned.at("group") * tuned.at("run");
  return std::clamp(n / (tuned.at("blocks") * std::max(ctx.device().compute_units, 1)), 1024L, 65536L);
}

// A group has a counter for each work-item and digit. If the device cannot run the tuned values, uses the defaults.
TunedValues tuned_for(const Context& ctx, long n, int bits) {
  const TunedValues asked = ctx.tuned({TunedOp::radix_sort, {n, bits}});
  if (ctx.flavour() == Flavour::cpu) return asked;
  const auto group = static_cast<std::size_t>(asked.at("group"));
  const bool fits =
      group <= ctx.device().max_work_group && (4 * group << asked.at("digit")) <= ctx.device().local_memory;
  return fits ? asked : default_values(*asked.of);
}

}  // namespace

Sorted radix_sort(Context& ctx, Tensor keys, Tensor values, int bits) {
  const bool wide = keys.type() == Type::u64;
  Dims d;
  const long n = d.bind("keys", keys, {"n"}, wide ? Type::u64 : Type::u32)["n"];
  d.bind_optional("values", values, {"n"}, Type::u32);
  if (bits < 0 || bits > (wide ? 64 : 32)) fail(Status::internal, "radix_sort: {} bits of {}", bits, keys.describe());
  if (n >= (1L << 31)) fail(Status::memory, "radix_sort: {} keys, at most 2^31 - 1 can be sorted", n);

  const bool cpu = ctx.flavour() == Flavour::cpu;
  const TunedValues tuned = tuned_for(ctx, n, bits);
  const int most = static_cast<int>(tuned.at("digit"));
  // If there are no bits to sort by, one pass is still needed to make the values.
  const int passes = std::max((bits + most - 1) / most, values ? 0 : 1);
  if (passes == 0 || n == 0) return {keys, values ? values : ctx.tensor({n}, Type::u32, "radix_sort.values")};
  const int digit = std::max((bits + passes - 1) / passes, 1);

  const long block = block_size(ctx, tuned, n), blocks = (n + block - 1) / block;
  const std::string defines = "-DDIGIT_BITS=" + std::to_string(most) + (wide ? " -DKEY64" : "") +
                              (cpu ? "" : " -DWG=" + std::to_string(tuned.at("group")));
  const KernelId count{"radix_sort", cpu ? "radix_histogram_cpu" : "radix_histogram_gpu", defines};
  const KernelId scatter{"radix_sort", cpu ? "radix_scatter_cpu" : "radix_scatter_gpu", defines};
  const Range range = groups(blocks, cpu ? 1 : tuned.at("group"));
  const double key_bytes = static_cast<double>(keys.bytes());

  Sorted other{ctx.tensor({n}, keys.type(), "radix_sort.keys"), ctx.tensor({n}, Type::u32, "radix_sort.values")};
  const long digits = 1L << digit;
  const Tensor histogram = ctx.tensor({digits * blocks}, Type::u32, "radix_sort.histogram");
  const Tensor offsets = cpu ? histogram : ctx.tensor({digits * blocks + 1}, Type::u32, "radix_sort.offsets");
  for (int pass = 0; pass < passes; ++pass) {
    const int shift = pass * digit;
    const long here = 1L << std::min(digit, bits - shift);  // the last digit may be shorter
    const auto mask = static_cast<unsigned>(here - 1);
    ctx.launch(count, range, {0, key_bytes}, keys, written(histogram), static_cast<unsigned>(n),
               static_cast<unsigned>(block), static_cast<unsigned>(blocks), shift, mask);
    if (!cpu) exclusive_scan(ctx, histogram.first(here * blocks), offsets.first(here * blocks + 1));
    ctx.launch(scatter, range, {0, 2 * key_bytes + 8.0 * static_cast<double>(n)}, keys, values, offsets,
               written(other.keys), written(other.values), static_cast<unsigned>(n), static_cast<unsigned>(block),
               static_cast<unsigned>(blocks), shift, mask);
    if (!values && pass + 1 < passes) values = ctx.tensor({n}, Type::u32, "radix_sort.values");
    std::swap(keys, other.keys);
    std::swap(values, other.values);
  }
  return {keys, values};
}

}  // namespace vsplat
