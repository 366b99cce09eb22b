#include "model/ops/dense/gather.h"

#include <memory>

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> gather_cases(const Options&) {
  return {
      {"rows forward",
       [](Context& ctx) {
         GatherForward a{random(ctx, {kVoxels, 128}, 1), selected_voxels(ctx), ctx.tensor({kSelected, 128})};
         return operation(ctx, [&ctx, a] { gather_forward(ctx, a); }, {a.out});
       }},
      {"rows backward",
       [](Context& ctx) {
         GatherBackward a{random(ctx, {kSelected, 128}, 1), selected_voxels(ctx), random(ctx, {kVoxels, 128}, 2)};
         return operation(ctx, [&ctx, a] { gather_backward(ctx, a); }, {a.dx});
       }},
      {"integers",
       [](Context& ctx) {
         const Tensor index = selected_voxels(ctx);
         std::vector<int> rows(static_cast<std::size_t>(kVoxels));
         for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(i);
         const Tensor x = ctx.upload({kVoxels}, rows, Type::i32);
         const auto out = std::make_shared<Tensor>();
         return operation_with(
             ctx, [&ctx, x, index, out] { *out = gather_integers(ctx, x, index); },
             [out] { return std::vector{*out}; });
       }},
      {"gaussians forward",
       [](Context& ctx) {
         const DeviceGaussians x = random_gaussians(ctx, kVoxels, 1);
         const Tensor index = selected_voxels(ctx);
         const auto out = std::make_shared<DeviceGaussians>();
         return operation_with(
             ctx, [&ctx, x, index, out] { *out = gather_forward(ctx, x, index); },
             [out] {
               return std::vector{out->means, out->sh};
             });
       }},
      {"gaussians backward",
       [](Context& ctx) {
         const GaussianGradients dout = random_gradients(ctx, kSelected, 1), dx = random_gradients(ctx, kVoxels, 6);
         const Tensor index = selected_voxels(ctx);
         return operation(ctx, [&ctx, dout, index, dx] { gather_backward(ctx, dout, index, dx); }, {dx.means, dx.sh});
       }},
  };
}

}  // namespace vsplat::bench
