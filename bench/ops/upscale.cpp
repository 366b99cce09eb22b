// GenDen's second level: 9,600 x 2 points to four each.
#include "model/ops/networks/upscale.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

constexpr long kParents = 19200, kChildren = 4, kParentChannels = 256, kWaveFrequencies = 15,
               kWaveWidth = 6 * kWaveFrequencies + kParentChannels;

}  // namespace

std::vector<Case> upscale_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const UpscaleForward a{random(ctx, {kParents, 3 * kChildren}, 1),
                                random(ctx, {kParents, 3}, 2),
                                random(ctx, {kParents, kParentChannels}, 3),
                                kWaveFrequencies,
                                1.0 / 256,
                                1,
                                ctx.tensor({kParents * kChildren, 3}),
                                ctx.tensor({kParents * kChildren, 3}),
                                ctx.tensor({kParents * kChildren, kWaveWidth})};
         return operation(ctx, [&ctx, a] { upscale_forward(ctx, a); }, {a.children, a.offsets, a.wide});
       }},
      {"backward",
       [](Context& ctx) {
         const UpscaleBackward a{random(ctx, {kParents, 3 * kChildren}, 1),
                                 kWaveFrequencies,
                                 1.0 / 256,
                                 1,
                                 random(ctx, {kParents * kChildren, 3}, 2),
                                 random(ctx, {kParents * kChildren, kWaveWidth}, 3),
                                 ctx.tensor({kParents, 3 * kChildren}),
                                 ctx.tensor({kParents, 3}),
                                 random(ctx, {kParents, kParentChannels}, 4)};
         return operation(ctx, [&ctx, a] { upscale_backward(ctx, a); }, {a.draw, a.dpoints, a.dfeature});
       }},
  };
}

}  // namespace vsplat::bench
