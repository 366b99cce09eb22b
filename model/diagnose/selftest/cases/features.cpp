// Features of the views at points and voxels.
#include <algorithm>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/diagnose/selftest/reference/lift.h"
#include "model/diagnose/selftest/reference/sample_points.h"
#include "model/diagnose/selftest/reference/view_maps.h"
#include "model/ops/dense/scatter_rows.h"
#include "model/ops/networks/lift.h"
#include "model/ops/networks/project_features.h"
#include "model/ops/networks/view_maps.h"
#include "model/ops/volume/sample_points.h"

namespace vsplat::selftest {
namespace {

std::size_t feature_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

std::vector<double> plus_before(std::vector<double> sums, const std::vector<float>& before) {
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
  return sums;
}

void lift_all(Checks& c) {
  struct Try {
    int views, tokens, channels, volume;
    bool half_pixel;
  };
  for (const Try& t : c.some({Try{2, 3, 3, 3, true}, {3, 6, 16, 4, true}, {3, 4, 17, 3, false}, {4, 5, 33, 2, true}})) {
    const int patch = 8, image = t.tokens * patch;
    const auto cameras = orbit(t.views, image);
    const DeviceCameras on_device = upload_cameras(c.ctx, cameras);
    const long v = t.views, ch = t.channels, texels = v * t.tokens * t.tokens;
    const long voxels = static_cast<long>(t.volume) * t.volume * t.volume;
    const auto features = random_floats(feature_size(texels, ch), 1, -1.0f, 2.0f),
               bias = random_floats(feature_size(ch), 2), before = random_floats(features.size(), 3),
               dmean = random_floats(feature_size(voxels, ch), 4),
               dvariance = random_floats(feature_size(voxels, ch), 5),
               dsamples = random_floats(feature_size(voxels * v, ch), 6);
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
    for (std::size_t i = 0; i < shifted.size(); ++i) shifted[i] += bias[i % feature_size(ch)];
    c.close("mean", mean, shifted, 2e-5);
    const ScatterPlan plan = make_scatter_plan(c.ctx, index, weight, texels);
    c.keep();
    const std::vector<float> none(dmean.size(), 0.0f);
    const auto gradient = [&](const std::vector<float>& by_mean, const std::vector<float>& by_variance) {
      return plus_before(
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
          return plus_before(ref::lift_samples_gradient(feature_size(texels), t.tokens, ch, cameras, image,
                                                        t.half_pixel, t.volume, dsamples),
                             before);
        },
        2e-5);
  }
}

void project_features_all(Checks& c) {
  struct Try {
    int views;
    long t, channels, points;
    bool half_pixel, by_distance;
    float reach = 0.5f;
  };
  for (const Try& t : c.some({Try{1, 7, 1, 1, true, false},
                              {2, 3, 3, 17, true, false},
                              {3, 6, 24, 31, false, false},
                              {4, 8, 130, 33, true, true},
                              {3, 5, 4, 300, true, false, 1.2f}})) {
    ref::ProjectFeaturesCase want;
    want.t = t.t, want.channels = t.channels, want.half_pixel = t.half_pixel, want.by_distance = t.by_distance;
    want.image = static_cast<int>(8 * t.t), want.cameras = orbit(t.views, want.image);
    const long v = t.views;
    const auto features = random_floats(feature_size(v * t.t * t.t, t.channels), 31),
               points = random_floats(feature_size(3 * t.points), 32, -t.reach, t.reach),
               dout = random_floats(feature_size(t.points, t.channels), 33), before = random_floats(points.size(), 34),
               already = random_floats(features.size(), 36);
    want.features = as_doubles(features), want.points = as_doubles(points);
    const DeviceCameras cameras = upload_cameras(c.ctx, want.cameras);
    ProjectFeaturesBackward b;
    b.forward = {c.up({v, t.t, t.t, t.channels}, features),
                 c.up({t.points, 3}, points),
                 &cameras,
                 want.image,
                 t.half_pixel,
                 t.by_distance,
                 c.gap({t.points, t.channels})};
    project_features_forward(c.ctx, b.forward);
    c.close("forward", b.forward.out, ref::project_features(want), 2e-5);
    b.dout = c.up({t.points, t.channels}, dout), b.dpoints = c.up({t.points, 3}, before);
    b.dfeatures = c.up({v, t.t, t.t, t.channels}, already);
    project_features_backward(c.ctx, b);
    const auto by = ref::project_features_backward(want, dout);
    c.close("backward, dpoints", b.dpoints, plus_before(by.points, before), 2e-5);
    c.close("backward, dfeatures", b.dfeatures, plus_before(by.features, already), 2e-5);
  }
}

void sample_points_all(Checks& c) {
  struct Try {
    int views;
    long size, points;
    bool half_pixel;
    float reach;
  };
  for (const Try& t :
       c.some({Try{1, 1, 1, true, 0.5f}, {2, 7, 17, true, 0.5f}, {3, 8, 31, false, 0.5f}, {3, 5, 65, true, 1.2f}})) {
    ref::SamplePointsCase want;
    want.size = t.size, want.half_pixel = t.half_pixel, want.cameras = orbit(t.views, static_cast<int>(t.size));
    const long v = t.views;
    const auto maps = random_floats(feature_size(v * t.size * t.size, 8), 31),
               points = random_floats(feature_size(3 * t.points), 32, -t.reach, t.reach),
               dout = random_floats(feature_size(8 * v, t.points), 33), before = random_floats(points.size(), 34),
               already = random_floats(maps.size(), 35);
    want.maps = as_doubles(maps), want.points = as_doubles(points);
    const DeviceCameras cameras = upload_cameras(c.ctx, want.cameras);
    const SamplePointsForward f{c.up({v, t.size, t.size, 8}, maps), c.up({t.points, 3}, points), &cameras, t.half_pixel,
                                c.gap({t.points, v, 8})};
    sample_points_forward(c.ctx, f);
    c.close_by_column("forward", c.ctx.read<float>(f.out), 8, want.all(), 2e-5);
    const Tensor dpoints = c.up({t.points, 3}, before), dmaps = c.up({v, t.size, t.size, 8}, already);
    sample_points_backward(c.ctx, {f, c.up({t.points, v, 8}, dout), dpoints, dmaps});
    c.close(
        "backward, dpoints", dpoints, [&] { return plus_before(want.points_gradient(dout), before); }, 5e-5);
    c.close(
        "backward, dmaps", dmaps, [&] { return plus_before(want.maps_gradient(dout), already); }, 2e-5);
  }
}

void view_maps_all(Checks& c) {
  for (const bool by_alpha : {false, true}) {
    constexpr long views = 3, edge = 7, first = 1, drawn = 2;
    constexpr std::size_t pixels = drawn * edge * edge, before = first * edge * edge;
    const auto images = random_floats(3 * views * edge * edge, 1, 0, 1),
               colour = random_floats(3 * pixels, 2, -0.5f, 1.5f), dmaps = random_floats(8 * views * edge * edge, 5);
    auto alpha = random_floats(pixels, 3, -0.5f, 1), depth = random_floats(pixels, 4, 0.5f, 3);
    for (std::size_t i = 0; i < pixels; ++i)
      if (alpha[i] <= 0) alpha[i] = depth[i] = 0;  // nothing in it
    std::vector<double> want(8 * views * edge * edge, 9.0), dcolour, dalpha, ddepth;
    for (std::size_t i = 0; i < pixels; ++i) {
      const std::size_t at = before + i;
      const double drawing[3] = {colour[3 * i], colour[3 * i + 1], colour[3 * i + 2]};
      const auto rest = ref::view_map(drawing, alpha[i], depth[i], by_alpha);
      for (std::size_t k = 0; k < 3; ++k) want[8 * at + k] = images[3 * at + k];
      std::copy(rest.begin(), rest.end(), want.begin() + static_cast<long>(8 * at + 3));
      const float* by = &dmaps[8 * at + 3];
      for (int k = 0; k < 3; ++k) dcolour.push_back(drawing[k] > 0 && drawing[k] < 1 ? by[k] : 0);
      const double a = alpha[i], d = depth[i];
      const bool divided = by_alpha && a > 0;
      dalpha.push_back(by[3] - (divided ? by[4] * d / (a * a) : 0));
      ddepth.push_back(divided ? by[4] / a : by_alpha ? 0 : by[4]);
    }
    const ViewDrawings there{c.up({drawn, edge, edge, 3}, colour), c.up({drawn, edge, edge}, alpha),
                             c.up({drawn, edge, edge}, depth)};
    const Tensor maps = c.up({views, edge, edge, 8}, std::vector<float>(want.size(), 9.0f));
    view_maps_forward(c.ctx, {c.up({views, edge, edge, 3}, images), there, first, by_alpha, maps});
    c.close("forward", maps, want, 1e-6);
    const ViewDrawings by{c.gap(there.colour.shape()), c.gap(there.alpha.shape()), c.gap(there.depth.shape())};
    view_maps_backward(c.ctx, {there, first, by_alpha, c.up({views, edge, edge, 8}, dmaps), by});
    c.close("backward, colour", by.colour, dcolour, 1e-5);
    c.close("backward, alpha", by.alpha, dalpha, 1e-5);
    c.close("backward, depth", by.depth, ddepth, 1e-5);
  }
}

}  // namespace

std::vector<Case> feature_cases() {
  return {{"lift", lift_all},
          {"project_features", project_features_all},
          {"sample_points", sample_points_all},
          {"view_maps", view_maps_all}};
}

}  // namespace vsplat::selftest
