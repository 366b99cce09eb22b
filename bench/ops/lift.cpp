#include "model/ops/networks/lift.h"

#include <memory>

#include "bench/ops/operation.h"
#include "model/diagnose/selftest/reference/project_features.h"

namespace vsplat::bench {
namespace {

constexpr long kMaps = kViews * kTokens * kTokens;   // rows of all views' maps
constexpr long kBlock = 8192, kFirst = kVoxels / 2;  // voxels at a time, from the middle of the volume
constexpr int kLiftSamples = 60;

// What all of them are given, and what they sample, in double.
struct Lifted {
  std::vector<Camera> views = orbit_cameras();
  std::vector<float> maps = random_floats(kMaps * kDim, 1);
  LiftCorners corners;

  explicit Lifted(Context& ctx) {
    LiftCorners& a = corners;
    a.cameras = upload_cameras(ctx, views);
    a.volume = static_cast<int>(kSide), a.tokens = static_cast<int>(kTokens), a.image = static_cast<int>(kImage);
    a.first = kFirst;
    a.index = ctx.tensor({kBlock, kViews, 4}, Type::i32), a.weight = ctx.tensor({kBlock, kViews, 4});
    lift_corners(ctx, a);
  }
  Tensor on_device(Context& ctx) const { return ctx.upload({kMaps, kDim}, maps); }

  // Where voxel `row` of the block is seen in a view, on its map.
  ref::MapPosition seen(long row, long view) const {
    const long voxel = kFirst + row;
    const Eigen::Vector3d at(static_cast<double>(voxel / (kSide * kSide)), static_cast<double>(voxel / kSide % kSide),
                             static_cast<double>(voxel % kSide));
    return ref::map_position(kTokens, views[static_cast<std::size_t>(view)], static_cast<int>(kImage), true,
                             (at.array() + 0.5) / static_cast<double>(kSide) - 0.5);
  }
  // How much texel (y, x) of that map is in the sample.
  static double share(const ref::MapPosition& at, long y, long x) {
    return std::max(0.0, 1 - std::abs(at.x - static_cast<double>(x))) *
           std::max(0.0, 1 - std::abs(at.y - static_cast<double>(y)));
  }
  double sample(long row, long view, long c) const {
    const ref::MapPosition at = seen(row, view);
    const auto x0 = static_cast<long>(std::floor(at.x)), y0 = static_cast<long>(std::floor(at.y));
    double sum = 0;
    for (const long y : {y0, y0 + 1})
      for (const long x : {x0, x0 + 1}) sum += share(at, y, x) * ref::texel(maps, kTokens, kDim, view, y, x, c);
    return sum;
  }
  double mean(long row, long c) const {
    double sum = 0;
    for (long view = 0; view < kViews; ++view) sum += sample(row, view, c) / static_cast<double>(kViews);
    return sum;
  }
  double variance(long row, long c) const {
    double sum = 0;
    for (long view = 0; view < kViews; ++view)
      sum += std::pow(sample(row, view, c) - mean(row, c), 2) / static_cast<double>(kViews);
    return sum;
  }
  // The gradient of a texel's channel: the sum over all samples that include it, of its share times by(row, view).
  template <class By>
  double gradient(long texel, const By& by) const {
    const long view = texel / (kTokens * kTokens), y = texel / kTokens % kTokens, x = texel % kTokens;
    double sum = 0;
    for (long row = 0; row < kBlock; ++row)
      if (const double in = share(seen(row, view), y, x); in > 0) sum += in * by(row, view);
    return sum;
  }
};

using Shared = std::shared_ptr<Lifted>;

// An operation on what Lifted has, and what its result's elements are to be.
Prepared sampled(Context& ctx, const std::function<void()>& run, const Tensor& out,
                 const std::function<double(long)>& want) {
  Prepared p = operation(ctx, run, {out});
  p.error = [&ctx, out, want] {
    const auto got = ctx.read<float>(out);
    return worst_error(
        static_cast<long>(got.size()), kLiftSamples, [&](long i) { return got[static_cast<std::size_t>(i)]; }, want);
  };
  return p;
}

// The four weights' sum over each axis has to bring back where the voxel is seen.
double corners_error(Context& ctx, const Lifted& l) {
  const auto index = ctx.read<int>(l.corners.index);
  const auto weight = ctx.read<float>(l.corners.weight);
  return worst_error(
      kBlock * kViews * 4, 4 * kLiftSamples, [&](long i) { return weight[static_cast<std::size_t>(i)]; },
      [&](long i) {
        const long row = i / 4 / kViews, view = i / 4 % kViews, texel = index[static_cast<std::size_t>(i)];
        const bool in_view = texel / (kTokens * kTokens) == view;  // else a place outside, of weight 0
        return in_view ? Lifted::share(l.seen(row, view), texel / kTokens % kTokens, texel % kTokens) : 0;
      });
}

Prepared prepare_corners(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  Prepared p = operation(ctx, [&ctx, l] { lift_corners(ctx, l->corners); }, {l->corners.index, l->corners.weight});
  p.error = [&ctx, l] { return corners_error(ctx, *l); };
  return p;
}

Prepared prepare_variance(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const LiftVarianceForward a{l->on_device(ctx), l->corners.index, l->corners.weight, ctx.tensor({kBlock, kDim})};
  return sampled(
      ctx, [&ctx, a] { lift_variance_forward(ctx, a); }, a.out,
      [l](long i) { return l->variance(i / kDim, i % kDim); });
}

Prepared prepare_mean(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const auto bias = random_floats(kDim, 2);
  const LiftMeanForward a{l->on_device(ctx),         l->corners.index, l->corners.weight, ctx.upload({kDim}, bias), 0,
                          ctx.tensor({kBlock, kDim})};
  return sampled(
      ctx, [&ctx, a] { lift_mean_forward(ctx, a); }, a.out,
      [l, bias](long i) {
        return l->mean(i / kDim, i % kDim) + static_cast<double>(bias[static_cast<std::size_t>(i % kDim)]);
      });
}

Prepared prepare_samples(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const LiftSamplesForward a{l->on_device(ctx), l->corners.index, l->corners.weight,
                             ctx.tensor({kBlock, kViews, kDim})};
  return sampled(
      ctx, [&ctx, a] { lift_samples_forward(ctx, a); }, a.out,
      [l](long i) { return l->sample(i / kDim / kViews, i / kDim % kViews, i % kDim); });
}

// Gradients are added to what is there, which one run has done when it is looked at. by(row, view, c) is that by a
// sample.
template <class By>
Prepared added(Context& ctx, const std::function<void(const Tensor& dmaps, const ScatterPlan& plan)>& run,
               const Shared& l, const By& by) {
  const auto before = random_floats(kMaps * kDim, 3);
  const Tensor dmaps = ctx.upload({kMaps, kDim}, before);
  const auto plan = std::make_shared<ScatterPlan>(make_scatter_plan(ctx, l->corners.index, l->corners.weight, kMaps));
  return sampled(
      ctx, [run, dmaps, plan] { run(dmaps, *plan); }, dmaps,
      [l, before, by](long i) {
        return static_cast<double>(before[static_cast<std::size_t>(i)]) +
               l->gradient(i / kDim, [&](long row, long view) { return by(row, view, i % kDim); });
      });
}

double at_row(const std::vector<float>& rows, long row, long c) {
  return static_cast<double>(rows[static_cast<std::size_t>(row * kDim + c)]);
}

Prepared prepare_samples_backward(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const auto dout = random_floats(kBlock * kViews * kDim, 2);
  const Tensor given = ctx.upload({kBlock, kViews, kDim}, dout);
  return added(
      ctx,
      [&ctx, given](const Tensor& dmaps, const ScatterPlan& plan) {
        lift_samples_backward(ctx, {&plan, given, dmaps});
      },
      l, [dout](long row, long view, long c) { return at_row(dout, row * kViews + view, c); });
}

Prepared prepare_variance_backward(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const auto dout = random_floats(kBlock * kDim, 2);
  const Tensor given = ctx.upload({kBlock, kDim}, dout), maps = l->on_device(ctx);
  return added(
      ctx,
      [&ctx, given, maps, l](const Tensor& dmaps, const ScatterPlan& plan) {
        lift_variance_backward(ctx, {maps, l->corners.index, l->corners.weight, &plan, given, dmaps});
      },
      l,
      [l, dout](long row, long view, long c) {
        return at_row(dout, row, c) * 2 * (l->sample(row, view, c) - l->mean(row, c)) / static_cast<double>(kViews);
      });
}

Prepared prepare_mean_backward(Context& ctx) {
  const Shared l = std::make_shared<Lifted>(ctx);
  const auto dout = random_floats(kBlock * kDim, 2);
  const Tensor given = ctx.upload({kBlock, kDim}, dout);
  return added(
      ctx,
      [&ctx, given](const Tensor& dmaps, const ScatterPlan& plan) {
        lift_mean_backward(ctx, {kViews, &plan, given, 0, dmaps});
      },
      l, [dout](long row, long, long c) { return at_row(dout, row, c) / static_cast<double>(kViews); });
}

}  // namespace

std::vector<Case> lift_cases(const Options&) {
  return {{"corners", prepare_corners},
          {"variance forward", prepare_variance},
          {"mean forward", prepare_mean},
          {"samples forward", prepare_samples},
          {"samples backward", prepare_samples_backward},
          {"variance backward", prepare_variance_backward},
          {"mean backward", prepare_mean_backward}};
}

}  // namespace vsplat::bench
