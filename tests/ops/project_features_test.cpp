#include "model/ops/project_features.h"

#include "tests/reference/project_features.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

class ProjectFeatures : public test::FlavourTest {
 protected:
  void check(long views, long t, long c, long p, bool half_pixel, bool by_distance, float reach = 0.5f) {
    const int image = static_cast<int>(8 * t);
    const std::vector<Camera> cameras = test::orbit(static_cast<int>(views), image);
    const std::vector<float> features = test::random_floats(static_cast<std::size_t>(views * t * t * c), 31);
    const std::vector<float> points = test::random_floats(static_cast<std::size_t>(3 * p), 32, -reach, reach);
    const DeviceCameras device = upload_cameras(ctx(), cameras);
    ProjectFeaturesForward a;
    a.features = ctx().upload({views, t, t, c}, features);
    a.points = ctx().upload({p, 3}, points);
    a.cameras = &device;
    a.image = image;
    a.half_pixel = half_pixel;
    a.by_distance = by_distance;
    a.out = ctx().upload({p, c}, test::nans(static_cast<std::size_t>(p * c)));
    project_features_forward(ctx(), a);
    const auto want = ref::project_features(features, t, c, cameras, image, half_pixel, by_distance, points);
    // A texel's position is exact to about 1e-6 t, and neighbouring texels differ by up to 2.
    EXPECT_TRUE(test::close(ctx().read<float>(a.out), want, 2e-5))
        << views << " views, " << t << " texels, " << c << " x " << p;
  }
};
VSPLAT_FLAVOURS(ProjectFeatures);

TEST_P(ProjectFeatures, MatchesReference) {
  check(1, 7, 1, 1, true, false);
  check(2, 3, 3, 17, true, false);
  check(3, 6, 24, 31, false, false);
  check(4, 8, 130, 33, true, true);
  check(4, 8, 6, 33, false, true);
}

// Many points fall outside the maps, on their borders, and behind cameras.
TEST_P(ProjectFeatures, OutsideTheMapsIsZero) { check(3, 5, 4, 500, true, false, 1.2f); }

TEST_P(ProjectFeatures, EmptyInput) {
  const DeviceCameras device = upload_cameras(ctx(), test::orbit(2, 16));
  ProjectFeaturesForward a;
  a.features = ctx().tensor({2, 2, 2, 3});
  a.points = ctx().tensor({0, 3});
  a.cameras = &device;
  a.image = 16;
  a.out = ctx().tensor({0, 3});
  project_features_forward(ctx(), a);
  EXPECT_TRUE(ctx().read<float>(a.out).empty());
}

TEST_P(ProjectFeatures, RejectsBadShape) {
  const DeviceCameras device = upload_cameras(ctx(), test::orbit(3, 16));
  ProjectFeaturesForward a;
  a.features = ctx().tensor({2, 2, 2, 3});
  a.points = ctx().tensor({5, 3});
  a.cameras = &device;
  a.out = ctx().tensor({5, 3});
  EXPECT_THROW(project_features_forward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
