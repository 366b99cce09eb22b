// One in seven is nearly transparent and moves, and one in twenty is new.
#include "model/ops/fit/splat_relocate.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

SplatParameters rows(Context& ctx, std::uint32_t seed) {
  return {random(ctx, {kVoxels, 3}, seed), random(ctx, {kVoxels, 3}, seed + 1, -6, -4),
          random(ctx, {kVoxels, 4}, seed + 2), random(ctx, {kVoxels}, seed + 3, -7, 3),
          random(ctx, {kVoxels, kSh, 3}, seed + 4)};
}

}  // namespace

std::vector<Case> splat_relocate_cases(const Options&) {
  return {
      {"relocate and grow",
       [](Context& ctx) {
         const SplatRelocate a{{rows(ctx, 1), rows(ctx, 6), rows(ctx, 11)}, kVoxels * 20 / 21, kVoxels, 1, 2};
         return operation(ctx, [&ctx, a] { splat_relocate(ctx, a); }, {a.all.x.logits, a.all.x.sh});
       }},
      {"noise",
       [](Context& ctx) {
         const SplatNoise a{rows(ctx, 1), 1, 1, 2};
         return operation(ctx, [&ctx, a] { splat_noise(ctx, a); }, {a.x.means});
       }},
  };
}

}  // namespace vsplat::bench
