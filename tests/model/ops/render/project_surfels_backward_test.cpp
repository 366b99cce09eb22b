#include <gtest/gtest.h>

#include <cmath>

#include "model/ops/render/project_surfels.h"
#include "tests/support/device.h"
#include "tests/support/projection_rows.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class ProjectSurfelsBackward : public test::FlavourTest {
 protected:
  struct Problem {
    Gaussians g;
    Camera camera;
    ref::SurfelOptions options;
    test::ProjectionRows rows;
  };

  static Problem make(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& options) {
    return {g, cam, options, test::surfel_rows(g, cam, options)};
  }

  struct Device {
    Projected visible;
    Tensor offsets;
    IntersectionGradients intersections;
  };

  Device to_device(const test::ProjectionRows& p) {
    const long n = static_cast<long>(p.ids.size()), m = static_cast<long>(p.touched.size());
    Device d;
    d.visible.ids = ctx().upload({n}, p.ids, Type::u32);
    d.visible.records = ctx().upload({n, 20}, p.records);
    d.offsets = ctx().upload({n + 1}, p.offsets, Type::u32);
    d.intersections = {ctx().upload({m, 20}, p.rows), ctx().upload({m}, p.touched, Type::u8)};
    return d;
  }

  struct Result {
    Gaussians gradient;
    std::vector<float> pose;
  };

  // The surfels in chunks of so many.
  Result run(const Problem& p, long chunk) {
    const Camera other = test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
    const Tensor views = upload_views(ctx(), {other, p.camera}, 0.2f, {});
    const Device d = to_device(p.rows);
    Result result;
    const Tensor twists = ctx().tensor({d.visible.ids.dim(0), 6});
    const auto count = static_cast<long>(p.g.count);
    for (long base = 0; base == 0 || base < count; base += chunk) {
      const long n = std::min(chunk, count - base);
      const GaussianGradients out = zero_gradients(ctx(), n, p.g.sh_degree, GaussianKind::surfel);
      project_surfels_backward(
          ctx(), {upload(ctx(), p.g, base, n), base, views, 1, false, d.visible, d.offsets, d.intersections, out,
                  twists, p.options.current ? SurfelRevision::current : SurfelRevision::lara});
      const Gaussians part = download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh});
      const auto append = [](std::vector<float>& to, const std::vector<float>& from) {
        to.insert(to.end(), from.begin(), from.end());
      };
      append(result.gradient.means, part.means), append(result.gradient.scales, part.scales);
      append(result.gradient.quats, part.quats), append(result.gradient.opacities, part.opacities);
      append(result.gradient.sh, part.sh);
    }
    result.pose = ctx().read<float>(sum_twists(ctx(), twists));
    return result;
  }
};

TEST_P(ProjectSurfelsBackward, TakesTheSceneInChunks) {
  const test::SceneCase c{"", 50, 1, 64, 64, ""};
  const Problem p = make(test::make_surfels(c, 36), test::make_camera(c, 36), {});
  const Result whole = run(p, 50), parts = run(p, 17);
  EXPECT_EQ(parts.gradient.means, whole.gradient.means);
  EXPECT_EQ(parts.gradient.scales, whole.gradient.scales);
  EXPECT_EQ(parts.gradient.sh, whole.gradient.sh);
  EXPECT_EQ(parts.pose, whole.pose);
}

TEST_P(ProjectSurfelsBackward, RejectsBadShape) {
  const test::SceneCase c{"", 4, 1, 32, 32, ""};
  const DeviceGaussians g = upload(ctx(), test::make_surfels(c, 35));
  GaussianGradients out = zero_gradients(ctx(), 4, 1, GaussianKind::surfel);
  const Tensor views = upload_views(ctx(), {test::make_camera(c, 35)}, 0.2f, {});
  Device d;
  d.visible.ids = ctx().tensor({2}, Type::u32);
  d.visible.records = ctx().tensor({2, 20});
  d.offsets = ctx().tensor({3}, Type::u32);
  d.intersections = {ctx().tensor({7, 20}), ctx().tensor({7}, Type::u8)};
  const auto run_with = [&](long view, const Tensor& twists) {
    project_surfels_backward(ctx(), {g, 0, views, view, false, d.visible, d.offsets, d.intersections, out, twists});
  };
  EXPECT_THROW(run_with(1, Tensor()), Error);
  EXPECT_THROW(run_with(0, ctx().tensor({3, 6})), Error);
  d.offsets = ctx().tensor({2}, Type::u32);
  EXPECT_THROW(run_with(0, Tensor()), Error);
  d.offsets = ctx().tensor({3}, Type::u32);
  out.scales = ctx().tensor({4, 3});
  EXPECT_THROW(run_with(0, Tensor()), Error);
}

VSPLAT_FLAVOURS(ProjectSurfelsBackward);

}  // namespace
}  // namespace vsplat
