#include "model/ops/dense/patch_embed.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> patch_embed_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const std::vector<float> w = random_floats(3 * kPatch * kPatch * kDim, 2, -0.05f, 0.05f);
         const auto packed = std::make_shared<PackedMatrix>(
             pack_matrix(ctx, w.data(), 3 * kPatch * kPatch, kDim, 1, 3 * kPatch * kPatch, "patch embedding"));
         PatchEmbedForward a{random(ctx, {kViews, kImage, kImage, 3}, 1, 0, 1),
                             static_cast<int>(kPatch),
                             packed.get(),
                             random(ctx, {kDim}, 3),
                             random(ctx, {1 + kTokens * kTokens, kDim}, 4),
                             ctx.tensor({kViews, 1 + kTokens * kTokens, kDim})};
         return operation(ctx, [&ctx, a, packed] { patch_embed_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         PatchEmbedBackward a{random(ctx, {kViews, kImage, kImage, 3}, 1, 0, 1),
                              static_cast<int>(kPatch),
                              random(ctx, {kViews, 1 + kTokens * kTokens, kDim}, 2),
                              random(ctx, {kDim, 3, kPatch, kPatch}, 3),
                              random(ctx, {kDim}, 4),
                              ctx.tensor({1 + kTokens * kTokens, kDim})};
         return operation(ctx, [&ctx, a] { patch_embed_backward(ctx, a); }, {a.dweight, a.dbias, a.dposition});
       }},
  };
}

}  // namespace vsplat::bench
