#include "model/ops/networks/project_features.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/project_features.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

// Points reach `reach` from the middle, along each axis.
ref::ProjectFeaturesCase make_case(long views, long t, long c, long p, bool half_pixel, bool by_distance, float reach) {
  ref::ProjectFeaturesCase in;
  in.t = t, in.channels = c, in.half_pixel = half_pixel, in.by_distance = by_distance;
  in.image = static_cast<int>(8 * t);
  in.cameras = test::orbit(static_cast<int>(views), in.image);
  for (const float x : test::random_floats(static_cast<std::size_t>(views * t * t * c), 31)) in.features.push_back(x);
  for (const float x : test::random_floats(static_cast<std::size_t>(3 * p), 32, -reach, reach)) in.points.push_back(x);
  return in;
}

// As the device takes it, which is given the cameras; out is all NaN.
ProjectFeaturesForward upload_project_features(Context& ctx, const ref::ProjectFeaturesCase& in,
                                               const DeviceCameras& cameras) {
  const long v = static_cast<long>(in.cameras.size()), p = static_cast<long>(in.points.size() / 3);
  ProjectFeaturesForward a;
  a.features = ctx.upload({v, in.t, in.t, in.channels}, test::as_floats(in.features));
  a.points = ctx.upload({p, 3}, test::as_floats(in.points));
  a.cameras = &cameras;
  a.image = in.image;
  a.half_pixel = in.half_pixel;
  a.by_distance = in.by_distance;
  a.out = ctx.upload({p, in.channels}, test::nans(static_cast<std::size_t>(p * in.channels)));
  return a;
}

class ProjectFeatures : public test::FlavourTest {};
VSPLAT_FLAVOURS(ProjectFeatures);
VSPLAT_OPERATION(ProjectFeatures, project_features)

TEST_P(ProjectFeatures, EmptyInput) {
  const auto in = make_case(2, 2, 3, 0, true, false, 1);
  const DeviceCameras cameras = upload_cameras(ctx(), in.cameras);
  ProjectFeaturesBackward b;
  b.forward = upload_project_features(ctx(), in, cameras);
  project_features_forward(ctx(), b.forward);
  EXPECT_TRUE(ctx().read<float>(b.forward.out).empty());
  b.dout = ctx().tensor({0, 3});
  b.dpoints = ctx().tensor({0, 3});
  const std::vector<float> before = test::random_floats(24, 36);
  b.dfeatures = ctx().upload({2, 2, 2, 3}, before);
  project_features_backward(ctx(), b);
  EXPECT_EQ(ctx().read<float>(b.dfeatures), before);
}

// The reference's, which is linear in the features, and smooth in the points between texels.
TEST(ProjectFeaturesReference, GradientsAreDifferences) {
  for (const bool by_distance : {false, true}) {
    auto in = make_case(3, 4, 2, 40, true, by_distance, 1.1f);
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
  const auto in = make_case(2, 2, 3, 5, true, false, 1);
  EXPECT_THROW(project_features_forward(ctx(), upload_project_features(ctx(), in, three)), Error);
  ProjectFeaturesBackward b;
  b.forward = upload_project_features(ctx(), in, two);
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
