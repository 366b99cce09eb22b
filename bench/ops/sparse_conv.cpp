#include "model/ops/volume/sparse_conv.h"

#include <memory>

#include "bench/ops/operation.h"
#include "model/ops/volume/sparse_map.h"

namespace vsplat::bench {
namespace {

constexpr long kChannels = 256;

RowSource neighbourhoods(Context& ctx) {
  RowSource in;
  in.x0 = random(ctx, {kSelected, kChannels}, 1);
  in.map = ctx.tensor({kSelected, 27}, Type::i32);
  sparse_map_forward(ctx, {selected_voxels(ctx), kSide, in.map});
  return in;
}

}  // namespace

std::vector<Case> sparse_conv_cases(const Options&) {
  return {
      {"submanifold forward",
       [](Context& ctx) {
         const auto w = random_floats(kChannels * 27 * kChannels, 2, -0.05f, 0.05f), bias = random_floats(kChannels, 3);
         const auto weights = std::make_shared<ConvWeights>(
             pack_submanifold(ctx, w.data(), bias.data(), kChannels, 27, kChannels, "bench"));
         SubmanifoldForward a;
         a.in = neighbourhoods(ctx), a.weights = weights.get(), a.out = ctx.tensor({kSelected, kChannels});
         return operation(ctx, [&ctx, a, weights] { submanifold_forward(ctx, a); }, {a.out});
       }},
      {"submanifold backward",
       [](Context& ctx) {
         SubmanifoldBackward a;
         a.in = neighbourhoods(ctx);
         a.w = random(ctx, {kChannels, 3, 3, 3, kChannels}, 2, -0.05f, 0.05f);
         a.dy = random(ctx, {kSelected, kChannels}, 3), a.dx = ctx.tensor({kSelected, kChannels});
         a.dw = random(ctx, a.w.shape(), 4), a.dbias = random(ctx, {kChannels}, 5);
         return operation(ctx, [&ctx, a] { submanifold_backward(ctx, a); }, {a.dx, a.dw, a.dbias});
       }},
  };
}

}  // namespace vsplat::bench
