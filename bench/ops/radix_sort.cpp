// A million keys, as of the pairs of Gaussians and tiles of a picture.
#include "model/ops/render/radix_sort.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kKeys = 1 << 20;

// Sorting overwrites its input, so a copy of it is sorted.
Prepared sort(Context& ctx, Type type, int bits) {
  std::vector<std::uint32_t> words(static_cast<std::size_t>(kKeys) * size_of(type) / 4);
  std::mt19937 engine(1);
  for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(engine());
  const Tensor keys = ctx.upload({kKeys}, words, type), copied = ctx.tensor({kKeys}, type);
  const auto out = std::make_shared<Sorted>();
  return operation_with(
      ctx,
      [&ctx, keys, copied, out, bits] {
        ctx.copy(keys, copied);
        *out = radix_sort(ctx, copied, {}, bits);
      },
      [out] { return std::vector{out->values}; });
}

}  // namespace

std::vector<Case> radix_sort_cases(const Options&) {
  return {
      {"u32", [](Context& ctx) { return sort(ctx, Type::u32, 32); }},
      {"u64", [](Context& ctx) { return sort(ctx, Type::u64, 44); }},
  };
}

}  // namespace vsplat::bench
