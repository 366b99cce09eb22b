#include "model/ops/networks/lift.h"

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
};
VSPLAT_FLAVOURS(Lift);
VSPLAT_OPERATION(Lift, lift)

TEST_P(Lift, InBlocks) {
  const LiftCase k{3, 6, 8, 17, 5, 1.6, true};
  const auto cameras = test::orbit(k.views, k.tokens * k.patch, k.radius);
  const auto features = test::random_floats(3 * 36 * 17, 1, -1, 2), bias = test::random_floats(17, 2),
             dmean = test::random_floats(125 * 17, 3), dvariance = test::random_floats(125 * 17, 4),
             before = test::random_floats(features.size(), 5);
  EXPECT_EQ(run(features, bias, cameras, k, 100), run(features, bias, cameras, k, 1000));
  const auto whole = run_backward(features, dmean, dvariance, before, cameras, k, 1000);
  EXPECT_TRUE(test::close(run_backward(features, dmean, dvariance, before, cameras, k, 50), whole, 1e-6));
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
