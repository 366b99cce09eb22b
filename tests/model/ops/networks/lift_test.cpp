#include "model/ops/networks/lift.h"

#include "model/diagnose/selftest/reference/lift.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

struct LiftCase {
  int views, tokens, patch, channels, volume;
  double radius;
  bool half_pixel;
};

class Lift : public test::FlavourTest {
 protected:
  // Variance and mean, in blocks of `block` voxels; the mean gets a bias.
  std::vector<std::vector<float>> run(const std::vector<float>& features, const std::vector<float>& bias,
                                      const std::vector<Camera>& cameras, const LiftCase& k, long block) {
    const long voxels = static_cast<long>(k.volume) * k.volume * k.volume, c = k.channels, v = k.views;
    const DeviceCameras on_device = upload_cameras(ctx(), cameras);
    const Tensor maps = ctx().upload({v * k.tokens * k.tokens, c}, features);
    const Tensor mean = ctx().upload({voxels, c}, test::nans(static_cast<std::size_t>(voxels * c)));
    const Tensor shift = ctx().upload({c}, bias);
    std::vector<float> variance;
    for (long first = 0; first < voxels; first += block) {
      const long n = std::min(block, voxels - first);
      const Tensor index = ctx().tensor({n, v, 4}, Type::i32);
      const Tensor weight = ctx().upload({n, v, 4}, test::nans(static_cast<std::size_t>(n * v * 4)));
      const Tensor part = ctx().upload({n, c}, test::nans(static_cast<std::size_t>(n * c)));
      lift_corners(ctx(), {on_device, k.volume, k.tokens, k.tokens * k.patch, k.half_pixel, first, index, weight});
      lift_variance_forward(ctx(), {maps, index, weight, part});
      lift_mean_forward(ctx(), {maps, index, weight, shift, first, mean});
      const auto values = ctx().read<float>(part);
      variance.insert(variance.end(), values.begin(), values.end());
    }
    return {ctx().read<float>(mean), variance};
  }

  // Both backwards, added to `before`.
  std::vector<float> run_backward(const std::vector<float>& features, const std::vector<float>& dmean,
                                  const std::vector<float>& dvariance, const std::vector<float>& before,
                                  const std::vector<Camera>& cameras, const LiftCase& k, long block) {
    const long voxels = static_cast<long>(k.volume) * k.volume * k.volume, c = k.channels, v = k.views;
    const long texels = v * k.tokens * k.tokens;
    const DeviceCameras on_device = upload_cameras(ctx(), cameras);
    const Tensor maps = ctx().upload({texels, c}, features), dmaps = ctx().upload({texels, c}, before);
    const Tensor by_mean = ctx().upload({voxels, c}, dmean);
    for (long first = 0; first < voxels; first += block) {
      const long n = std::min(block, voxels - first);
      const Tensor index = ctx().tensor({n, v, 4}, Type::i32), weight = ctx().tensor({n, v, 4});
      lift_corners(ctx(), {on_device, k.volume, k.tokens, k.tokens * k.patch, k.half_pixel, first, index, weight});
      const ScatterPlan plan = make_scatter_plan(ctx(), index, weight, texels);
      lift_mean_backward(ctx(), {v, &plan, by_mean, first, dmaps});
      const Tensor by_variance = ctx().upload({n, c}, dvariance.data() + first * c);
      lift_variance_backward(ctx(), {maps, index, weight, &plan, by_variance, dmaps});
    }
    return ctx().read<float>(dmaps);
  }

  void check_backward(const LiftCase& k) {
    const auto cameras = test::orbit(k.views, k.tokens * k.patch, k.radius);
    const auto c = static_cast<std::size_t>(k.channels), cells = static_cast<std::size_t>(k.volume);
    const auto texels = static_cast<std::size_t>(k.views * k.tokens * k.tokens);
    const auto features = test::random_floats(texels * c, 1, -1.0f, 2.0f);
    const auto dmean = test::random_floats(cells * cells * cells * c, 2), before = test::random_floats(texels * c, 4);
    const auto dvariance = test::random_floats(cells * cells * cells * c, 3);
    std::vector<double> want = ref::lift_gradient(features, k.tokens, k.channels, cameras, k.tokens * k.patch,
                                                  k.half_pixel, k.volume, dmean, dvariance);
    for (std::size_t i = 0; i < want.size(); ++i) want[i] += before[i];
    for (const long block : {50L, 1000L}) {
      const auto got = run_backward(features, dmean, dvariance, before, cameras, k, block);
      EXPECT_TRUE(test::close(got, want, 2e-5)) << k.views << " views, " << k.channels << " channels";
      EXPECT_EQ(run_backward(features, dmean, dvariance, before, cameras, k, block), got) << "the same bits";
    }
  }

  // The samples by themselves, and their backward.
  void check_samples(const LiftCase& k) {
    const auto cameras = test::orbit(k.views, k.tokens * k.patch, k.radius);
    const auto c = static_cast<std::size_t>(k.channels),
               texels = static_cast<std::size_t>(k.views) * k.tokens * k.tokens;
    const long voxels = static_cast<long>(k.volume) * k.volume * k.volume, v = k.views;
    const std::size_t values = static_cast<std::size_t>(voxels * v) * c;
    const auto features = test::random_floats(texels * c, 1, -1.0f, 2.0f), before = test::random_floats(texels * c, 4);
    const auto dout = test::random_floats(values, 5);
    const Tensor index = ctx().tensor({voxels, v, 4}, Type::i32), weight = ctx().tensor({voxels, v, 4});
    lift_corners(ctx(), {upload_cameras(ctx(), cameras), k.volume, k.tokens, k.tokens * k.patch, k.half_pixel, 0, index,
                         weight});
    const Tensor out = ctx().upload({voxels, v, k.channels}, test::nans(values));
    const Shape maps{static_cast<long>(texels), k.channels};
    lift_samples_forward(ctx(), {ctx().upload(maps, features), index, weight, out});
    EXPECT_TRUE(test::close(
        ctx().read<float>(out),
        ref::lift_samples(features, k.tokens, k.channels, cameras, k.tokens * k.patch, k.half_pixel, k.volume), 2e-5))
        << k.channels;
    const Tensor dmaps = ctx().upload(maps, before);
    const ScatterPlan plan = make_scatter_plan(ctx(), index, weight, static_cast<long>(texels));
    lift_samples_backward(ctx(), {&plan, ctx().upload({voxels, v, k.channels}, dout), dmaps});
    std::vector<double> want = ref::lift_samples_gradient(texels, k.tokens, k.channels, cameras, k.tokens * k.patch,
                                                          k.half_pixel, k.volume, dout);
    for (std::size_t i = 0; i < want.size(); ++i) want[i] += before[i];
    EXPECT_TRUE(test::close(ctx().read<float>(dmaps), want, 2e-5)) << k.channels;
  }

  void check(const LiftCase& k) {
    const auto cameras = test::orbit(k.views, k.tokens * k.patch, k.radius);
    const auto c = static_cast<std::size_t>(k.channels);
    const auto features =
        test::random_floats(static_cast<std::size_t>(k.views * k.tokens * k.tokens) * c, 1, -1.0f, 2.0f);
    const auto bias = test::random_floats(c, 2);
    const auto got = run(features, bias, cameras, k, 100);
    ref::Lifted want = ref::lift(features, k.tokens, k.channels, cameras, k.tokens * k.patch, k.half_pixel, k.volume);
    for (std::size_t i = 0; i < want.mean.size(); ++i) want.mean[i] += bias[i % c];
    // A texel's position in float32 is off by up to 1e-6 of the map, features change by 3 a texel.
    EXPECT_TRUE(test::close(got[0], want.mean, 2e-5)) << k.views << " views, " << k.channels << " channels";
    EXPECT_TRUE(test::close(got[1], want.variance, 2e-5, k.views == 1)) << k.views << " views";
    EXPECT_EQ(run(features, bias, cameras, k, 1000), got) << "cut in other blocks";
  }
};
VSPLAT_FLAVOURS(Lift);
VSPLAT_OPERATION(Lift, lift)

TEST_P(Lift, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const int channels : {1, 3, 7, 15, 16, 17, 33, 130}) check({3, 6, 8, channels, 5, 1.6, true});
  check({1, 1, 4, 5, 1, 1.6, true});
  check({16, 5, 3, 20, 4, 2.0, true});
}

TEST_P(Lift, WithoutHalfAPixel) { check({2, 6, 8, 9, 6, 1.6, false}); }

// Cameras so near that corners fall off the maps, and inside the cube, so that voxels lie behind them.
TEST_P(Lift, OutsideTheMapsAndBehindTheCameras) {
  check({3, 6, 8, 9, 6, 0.8, true});
  check({4, 7, 4, 18, 6, 0.3, true});
}

// A voxel's centre in the plane of a camera, and at its centre: 1/0 and 0/0 count as outside.
TEST_P(Lift, DepthZeroIsOutside) {
  Camera camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 8, camera.cx = camera.cy = 4;
  const LiftCase k{2, 4, 2, 3, 1, 0, true};
  const std::vector<float> features = test::random_floats(2 * 16 * 3, 1), bias = {1, 2, 3};
  Camera beside = camera;
  beside.w2c(0, 3) = 0.7;
  const auto got = run(features, bias, {camera, beside}, k, 10);
  EXPECT_EQ(got[0], bias);
  EXPECT_EQ(got[1], (std::vector<float>{0, 0, 0}));
}

TEST_P(Lift, BackwardMatchesReference) {
  for (const int channels : {1, 3, 7, 15, 16, 17, 33}) check_backward({3, 4, 8, channels, 5, 1.6, true});
  check_backward({1, 1, 4, 5, 1, 1.6, true});
  check_backward({16, 3, 3, 20, 4, 2.0, false});
  check_backward({3, 6, 8, 9, 6, 0.8, true});
  check_backward({4, 7, 4, 18, 6, 0.3, true});
}

TEST_P(Lift, SamplesOfEveryViewMatchReference) {
  for (const int channels : {1, 3, 7, 15, 16, 17, 33}) check_samples({3, 4, 8, channels, 5, 1.6, true});
  check_samples({1, 1, 4, 5, 1, 1.6, false});
  check_samples({4, 5, 4, 18, 6, 0.3, true});
}

TEST_P(Lift, RejectsBadShape) {
  const Tensor maps = ctx().tensor({8, 4}), index = ctx().tensor({5, 2, 4}, Type::i32);
  const Tensor weight = ctx().tensor({5, 2, 4}), bias = ctx().tensor({4}), out = ctx().tensor({5, 4});
  EXPECT_THROW(lift_variance_forward(ctx(), {maps, index, ctx().tensor({5, 3, 4}), out}), Error);
  EXPECT_THROW(lift_variance_forward(ctx(), {maps, weight, weight, out}), Error);
  EXPECT_THROW(lift_mean_forward(ctx(), {maps, index, weight, bias, 1, out}), Error);
  EXPECT_THROW(lift_samples_forward(ctx(), {maps, index, weight, out}), Error);
  const ScatterPlan plan = make_scatter_plan(ctx(), ctx().upload({5, 2, 4}, std::vector<int>(40, 1), Type::i32),
                                             ctx().upload({5, 2, 4}, std::vector<float>(40, 1.0f)), 8);
  EXPECT_THROW(lift_variance_backward(ctx(), {maps, index, weight, &plan, ctx().tensor({4, 4}), maps}), Error);
  EXPECT_THROW(lift_variance_backward(ctx(), {maps, index, weight, &plan, out, out}), Error);
  EXPECT_THROW(lift_mean_backward(ctx(), {2, &plan, out, 1, maps}), Error);
  EXPECT_THROW(lift_samples_backward(ctx(), {&plan, ctx().tensor({4, 2, 4}), maps}), Error);
  EXPECT_THROW(lift_mean_backward(ctx(), {0, &plan, out, 0, maps}), Error);
}

}  // namespace
}  // namespace vsplat
