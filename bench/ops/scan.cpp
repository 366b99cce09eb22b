#include "model/ops/render/scan.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kCount = 1 << 22;

}  // namespace

std::vector<Case> scan_cases(const Options&) {
  return {
      {"exclusive",
       [](Context& ctx) {
         const Tensor in = ctx.upload({kCount}, std::vector<std::uint32_t>(kCount, 3), Type::u32);
         const Tensor out = ctx.tensor({kCount + 1}, Type::u32);
         return operation(ctx, [&ctx, in, out] { exclusive_scan(ctx, in, out); }, {out});
       }},
  };
}

}  // namespace vsplat::bench
