#include "model/diagnose/selftest/reference/lift.h"

#include <algorithm>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/ops/dense/scatter_rows.h"
#include "model/ops/networks/lift.h"

namespace vsplat::selftest {
namespace {

void lift_all(Checks& c) {
  struct Try {
    int views, tokens, channels, volume;
    bool half_pixel;
    double radius = 1.6;
    int patch = 8;
  };
  for (const Try& t : c.some({Try{2, 3, 3, 3, true}, {3, 6, 16, 4, true}, {3, 4, 17, 3, false}, {4, 5, 33, 2, true}},
                             {{1, 1, 5, 1, true, 1.6, 4},
                              {16, 5, 20, 4, true, 2.0, 3},
                              {2, 6, 9, 6, false},
                              // Cameras so near that corners fall off the maps, and inside the cube.
                              {3, 6, 9, 6, true, 0.8},
                              {4, 7, 18, 6, true, 0.3, 4},
                              {3, 6, 1, 5, true},
                              {3, 6, 3, 5, true},
                              {3, 6, 7, 5, true},
                              {3, 6, 15, 5, true},
                              {3, 6, 16, 5, true},
                              {3, 6, 17, 5, true},
                              {3, 6, 33, 5, true},
                              {3, 6, 130, 5, true}})) {
    const int image = t.tokens * t.patch;
    const auto cameras = orbit(t.views, image, t.radius);
    const DeviceCameras on_device = upload_cameras(c.ctx, cameras);
    const long v = t.views, ch = t.channels, texels = v * t.tokens * t.tokens;
    const long voxels = static_cast<long>(t.volume) * t.volume * t.volume;
    const auto features = random_floats(size_of(texels, ch), 1, -1.0f, 2.0f), bias = random_floats(size_of(ch), 2),
               before = random_floats(features.size(), 3), dmean = random_floats(size_of(voxels, ch), 4),
               dvariance = random_floats(size_of(voxels, ch), 5), dsamples = random_floats(size_of(voxels * v, ch), 6);
    const Tensor maps = c.up({texels, ch}, features), index = c.ctx.tensor({voxels, v, 4}, Type::i32),
                 weight = c.gap({voxels, v, 4});
    lift_corners(c.ctx, {on_device, t.volume, t.tokens, image, t.half_pixel, 0, index, weight});
    c.keep();  // where voxels land
    const Tensor samples = c.gap({voxels, v, ch}), variance = c.gap({voxels, ch}), mean = c.gap({voxels, ch});
    lift_samples_forward(c.ctx, {maps, index, weight, samples});
    c.close(
        "samples", samples,
        [&] { return ref::lift_samples(features, t.tokens, ch, cameras, image, t.half_pixel, t.volume); }, 2e-5);
    const ref::Lifted want = ref::lift(features, t.tokens, ch, cameras, image, t.half_pixel, t.volume);
    lift_variance_forward(c.ctx, {maps, index, weight, variance});
    c.close("variance", variance, want.variance, 2e-5);
    lift_mean_forward(c.ctx, {maps, index, weight, c.up({ch}, bias), 0, mean});
    auto shifted = want.mean;
    for (std::size_t i = 0; i < shifted.size(); ++i) shifted[i] += bias[i % size_of(ch)];
    c.close("mean", mean, shifted, 2e-5);
    const ScatterPlan plan = make_scatter_plan(c.ctx, index, weight, texels);
    c.keep();
    const std::vector<float> none(dmean.size(), 0.0f);
    const auto gradient = [&](const std::vector<float>& by_mean, const std::vector<float>& by_variance) {
      return plus(
          ref::lift_gradient(features, t.tokens, ch, cameras, image, t.half_pixel, t.volume, by_mean, by_variance),
          before);
    };
    const Tensor by_mean = c.up({texels, ch}, before), by_variance = c.up({texels, ch}, before),
                 by_samples = c.up({texels, ch}, before);
    lift_mean_backward(c.ctx, {v, &plan, c.up({voxels, ch}, dmean), 0, by_mean});
    c.close(
        "mean, backward", by_mean, [&] { return gradient(dmean, none); }, 2e-5);
    lift_variance_backward(c.ctx, {maps, index, weight, &plan, c.up({voxels, ch}, dvariance), by_variance});
    c.close(
        "variance, backward", by_variance, [&] { return gradient(none, dvariance); }, 2e-5);
    lift_samples_backward(c.ctx, {&plan, c.up({voxels, v, ch}, dsamples), by_samples});
    c.close(
        "samples, backward", by_samples,
        [&] {
          return plus(ref::lift_samples_gradient(size_of(texels), t.tokens, ch, cameras, image, t.half_pixel, t.volume,
                                                 dsamples),
                      before);
        },
        2e-5);
    if (!c.all) continue;
    // In blocks: the gradients are summed in another order.
    const Tensor mean_again = c.gap({voxels, ch}), whole = c.up({texels, ch}, before),
                 parts = c.up({texels, ch}, before), by = c.up({voxels, ch}, dmean);
    const auto backward = [&](const ScatterPlan& from, const Tensor& at, const Tensor& of, long first, long n,
                              const Tensor& to) {
      lift_mean_backward(c.ctx, {v, &from, by, first, to});
      lift_variance_backward(c.ctx, {maps, at, of, &from, c.ctx.upload({n, ch}, dvariance.data() + first * ch), to});
    };
    backward(plan, index, weight, 0, voxels, whole);
    std::vector<float> variances;
    for (long first = 0; first < voxels; first += 50) {
      const long n = std::min(50L, voxels - first);
      const Tensor at = c.ctx.tensor({n, v, 4}, Type::i32), of = c.gap({n, v, 4}), part = c.gap({n, ch});
      lift_corners(c.ctx, {on_device, t.volume, t.tokens, image, t.half_pixel, first, at, of});
      lift_variance_forward(c.ctx, {maps, at, of, part});
      lift_mean_forward(c.ctx, {maps, at, of, c.up({ch}, bias), first, mean_again});
      const auto values = c.ctx.read<float>(part);
      variances.insert(variances.end(), values.begin(), values.end());
      backward(make_scatter_plan(c.ctx, at, of, texels), at, of, first, n, parts);
    }
    c.equal("variance, in blocks", variances, c.ctx.read<float>(variance));
    c.equal("mean, in blocks", mean_again, c.ctx.read<float>(mean));
    c.close("backward, in blocks", parts, c.ctx.read<float>(whole), 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(lift, {"lift", lift_all})

}  // namespace vsplat::selftest
