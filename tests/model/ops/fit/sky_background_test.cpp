#include "model/ops/fit/sky_background.h"

#include <Eigen/Geometry>

#include "model/base/scene.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SkyBackgroundOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SkyBackgroundOp);
VSPLAT_OPERATION(SkyBackgroundOp, sky_background)

// Whoever makes Gaussians of the sky evaluates it on the host.
TEST_P(SkyBackgroundOp, IsTheHostsBasisInThePixelsDirection) {
  Camera camera;
  camera.width = camera.height = 1;
  camera.fx = camera.fy = 1, camera.cx = camera.cy = 0.5;
  camera.w2c.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, -1).normalized()).matrix();
  const Eigen::Vector3d direction = camera.w2c.row(2).head<3>().transpose();
  const Tensor view = upload_views(ctx(), {camera}, 0.1f, {});
  const DevicePicture drawn{
      ctx().upload({1, 1, 3}, std::vector<float>(3, 0.0f)), ctx().upload({1, 1}, std::vector<float>(1, 0.0f)), {}};
  const Eigen::VectorXd basis = sh_basis(4, direction);
  ASSERT_EQ(basis.size(), kSkyBasis);
  for (long k = 0; k < kSkyBasis; ++k) {
    std::vector<float> sh(75, 0.0f);
    sh[static_cast<std::size_t>(3 * k + 1)] = 1;
    const Tensor out = ctx().upload({1, 1, 3}, test::nans(3));
    sky_background_forward(ctx(), {ctx().upload({25, 3}, sh), view, drawn, out});
    const auto got = ctx().read<float>(out);
    EXPECT_NEAR(got[1], 0.5 + basis[k], 1e-6) << k;
    EXPECT_EQ(got[0], 0.5f);
  }
}

// A sky behind what lets nothing through is not seen, and learns nothing.
TEST_P(SkyBackgroundOp, IsHiddenByWhatIsOpaque) {
  const auto colour = test::random_floats(30, 1, 0, 1);
  const DevicePicture drawn{ctx().upload({2, 5, 3}, colour), ctx().upload({2, 5}, std::vector<float>(10, 1.0f)), {}};
  Camera camera;
  camera.width = 5, camera.height = 2, camera.fx = camera.fy = 3, camera.cx = 2.5, camera.cy = 1;
  const Tensor view = upload_views(ctx(), {camera}, 0.1f, {}), sh = ctx().upload({25, 3}, test::random_floats(75, 2));
  const Tensor out = ctx().upload({2, 5, 3}, test::nans(30)), dsh = ctx().upload({25, 3}, test::nans(75));
  sky_background_forward(ctx(), {sh, view, drawn, out});
  EXPECT_EQ(ctx().read<float>(out), colour);
  const PictureGradient by{
      ctx().upload({2, 5, 3}, test::random_floats(30, 3)), ctx().upload({2, 5}, std::vector<float>(10, 0.0f)), {}};
  sky_background_backward(ctx(), {sh, view, drawn, by, dsh});
  EXPECT_EQ(ctx().read<float>(dsh), std::vector<float>(75, 0.0f));
}

}  // namespace
}  // namespace vsplat
