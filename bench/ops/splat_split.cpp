// One in seven is nearly transparent and gives its place away, and one in twenty is new.
#include "model/ops/fit/splat_split.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

SplatParameters split_rows(Context& ctx, std::uint32_t seed) {
  return {random(ctx, {kVoxels, 3}, seed), random(ctx, {kVoxels, 3}, seed + 1, -6, -4),
          random(ctx, {kVoxels, 4}, seed + 2), random(ctx, {kVoxels}, seed + 3, -7, 3),
          random(ctx, {kVoxels, kSh, 3}, seed + 4)};
}

// Four rows for each of the visible Gaussians, which are all.
Prepared scores_case(Context& ctx) {
  std::vector<std::uint32_t> ids, offsets{0};
  for (long k = 0; k < kVoxels; ++k) {
    ids.push_back(static_cast<std::uint32_t>(k));
    offsets.push_back(offsets.back() + 4);
  }
  Projected visible;
  visible.ids = ctx.upload({kVoxels}, ids, Type::u32);
  visible.records = random(ctx, {kVoxels, 12}, 3, 0, 1);
  const std::vector<std::uint8_t> touched(static_cast<std::size_t>(4 * kVoxels), 1);
  const SplatScores a{visible,
                      ctx.upload({kVoxels + 1}, offsets, Type::u32),
                      {random(ctx, {4 * kVoxels, 10}, 1, 0, 1), ctx.upload({4 * kVoxels}, touched, Type::u8)},
                      random(ctx, {kVoxels}, 2, 0, 1),
                      1000};
  return operation(ctx, [&ctx, a] { splat_scores(ctx, a); }, {a.scores});
}

}  // namespace

std::vector<Case> splat_split_cases(const Options&) {
  return {
      {"split and grow",
       [](Context& ctx) {
         const long count = kVoxels * 20 / 21;
         const SplatSplit a{{split_rows(ctx, 1), split_rows(ctx, 6), split_rows(ctx, 11)},
                            count,
                            kVoxels,
                            random(ctx, {count}, 16, 0, 1)};
         return operation(ctx, [&ctx, a] { splat_split(ctx, a); }, {a.all.x.logits, a.all.x.sh});
       }},
      {"error",
       [](Context& ctx) {
         const Tensor colour = random(ctx, {kImage, kImage, 3}, 1, 0, 1),
                      target = random(ctx, {kImage, kImage, 3}, 2, 0, 1),
                      error = ctx.tensor({kImage, kImage}, Type::f32, "error");
         return operation(ctx, [=, &ctx] { splat_error(ctx, colour, target, error); }, {error});
       }},
      {"scores", [](Context& ctx) { return scores_case(ctx); }},
      {"add scores",
       [](Context& ctx) {
         const Tensor fresh = random(ctx, {kVoxels}, 1, 0, 1), scores = random(ctx, {kVoxels}, 2, 0, 1);
         return operation(ctx, [=, &ctx] { add_scores(ctx, fresh, scores); }, {scores});
       }},
  };
}

}  // namespace vsplat::bench
