#include "model/ops/dense/conv3d_up.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {
namespace {

// LaRa's: 32^3 voxels of 256 channels to 64^3 of 80.
constexpr long kEdge = 32, kIn = 256, kOut = 80, kCount = kEdge * kEdge * kEdge;

}  // namespace

std::vector<Case> conv3d_up_cases(const Options&) {
  return {
      {"forward",
       [](Context& ctx) {
         const Tensor w = random(ctx, {kIn, kOut, 2, 2, 2}, 1, -0.05f, 0.05f);
         const auto packed = std::make_shared<PackedMatrix>(pack_conv3d_up(ctx, w, "weight"));
         Conv3dUpForward a;
         a.in = random(ctx, {kCount, kIn}, 2);
         a.x = a.y = a.z = kEdge;
         a.weights = packed.get();
         a.bias = random(ctx, {kOut}, 3);
         a.out = ctx.tensor({8 * kCount, kOut});
         return operation(ctx, [&ctx, a, packed] { conv3d_up_forward(ctx, a); }, {a.out});
       }},
      {"backward",
       [](Context& ctx) {
         Conv3dUpBackward a;
         a.in = random(ctx, {kCount, kIn}, 2);
         a.x = a.y = a.z = kEdge;
         a.w = random(ctx, {kIn, kOut, 2, 2, 2}, 1, -0.05f, 0.05f);
         a.dy = random(ctx, {8 * kCount, kOut}, 4);
         a.dx = ctx.tensor({kCount, kIn});
         a.dw = random(ctx, {kIn, kOut, 2, 2, 2}, 5);
         a.dbias = random(ctx, {kOut}, 6);
         return operation(ctx, [&ctx, a] { conv3d_up_backward(ctx, a); }, {a.dx, a.dw, a.dbias});
       }},
  };
}

}  // namespace vsplat::bench
