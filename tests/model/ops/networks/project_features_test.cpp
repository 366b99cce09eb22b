#include "model/ops/networks/project_features.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/project_features.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

class ProjectFeatures : public test::FlavourTest {};
VSPLAT_FLAVOURS(ProjectFeatures);
VSPLAT_OPERATION(ProjectFeatures, project_features)

// The reference's, which is linear in the features, and smooth in the points between texels.
TEST(ProjectFeaturesReference, GradientsAreDifferences) {
  for (const bool by_distance : {false, true}) {
    ref::ProjectFeaturesCase in;
    in.t = 4, in.channels = 2, in.image = 32, in.cameras = test::orbit(3, 32), in.by_distance = by_distance;
    in.features = test::random_doubles(3 * 4 * 4 * 2, 31), in.points = test::random_doubles(120, 32, -1.1f, 1.1f);
    const std::vector<float> dout = test::random_floats(80, 35);
    const auto differences = [&](std::vector<double>& x) {
      return ref::central_differences(x, 1e-6, [&] { return ref::weighed(ref::project_features(in), dout); });
    };
    const auto gradient = ref::project_features_backward(in, dout);
    EXPECT_TRUE(test::close(gradient.points, differences(in.points), 1e-6)) << by_distance;
    EXPECT_TRUE(test::close(gradient.features, differences(in.features), 1e-6)) << by_distance;
  }
}

TEST_P(ProjectFeatures, RejectsBadShape) {
  const DeviceCameras three = upload_cameras(ctx(), test::orbit(3, 16)),
                      two = upload_cameras(ctx(), test::orbit(2, 16));
  const Tensor features = ctx().tensor({2, 2, 2, 3}), points = ctx().tensor({5, 3}), out = ctx().tensor({5, 3});
  EXPECT_THROW(project_features_forward(ctx(), {features, points, &three, 16, true, false, out}), Error);
  ProjectFeaturesBackward b;
  b.forward = {features, points, &two, 16, true, false, out};
  b.dout = ctx().tensor({5, 4});
  b.dpoints = ctx().tensor({5, 3});
  b.dfeatures = ctx().tensor({2, 2, 2, 3});
  EXPECT_THROW(project_features_backward(ctx(), b), Error);
  b.dout = ctx().tensor({5, 3});
  b.dfeatures = ctx().tensor({3, 2, 2, 3});
  EXPECT_THROW(project_features_backward(ctx(), b), Error);
}

}  // namespace
}  // namespace vsplat
