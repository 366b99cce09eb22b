#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "model/ops/render/project_surfels.h"
#include "tests/support/compare.h"
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
    std::optional<std::array<float, 3>> mirror;
    if (p.options.options.mirror) {
      const Eigen::Vector3f m = p.options.options.mirror->cast<float>();
      mirror = {m.x(), m.y(), m.z()};
    }
    const Camera other = test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
    const Tensor views = upload_views(ctx(), {other, p.camera}, 0.2f, mirror);
    const Device d = to_device(p.rows);
    Result result;
    const Tensor twists = ctx().tensor({d.visible.ids.dim(0), 6});
    const auto count = static_cast<long>(p.g.count);
    for (long base = 0; base == 0 || base < count; base += chunk) {
      const long n = std::min(chunk, count - base);
      const GaussianGradients out = zero_gradients(ctx(), n, p.g.sh_degree, GaussianKind::surfel);
      for (int twice = 0; twice < 2; ++twice)  // it adds to what is there
        project_surfels_backward(
            ctx(), {upload(ctx(), p.g, base, n), base, views, 1, mirror.has_value(), d.visible, d.offsets,
                    d.intersections, out, twists, p.options.current ? SurfelRevision::current : SurfelRevision::lara});
      const Gaussians part = download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh});
      const auto append = [](std::vector<float>& to, const std::vector<float>& from) {
        for (const float v : from) to.push_back(0.5f * v);
      };
      append(result.gradient.means, part.means), append(result.gradient.scales, part.scales);
      append(result.gradient.quats, part.quats), append(result.gradient.opacities, part.opacities);
      append(result.gradient.sh, part.sh);
    }
    result.pose = ctx().read<float>(sum_twists(ctx(), twists));
    return result;
  }

  void check(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& options, double tolerance) {
    const Problem p = make(g, cam, options);
    const Result got = run(p, static_cast<long>(std::max<std::size_t>(g.count, 1)));
    const auto compare = [&](const std::vector<float>& values, std::vector<float> Gaussians::*field, std::size_t each,
                             const std::function<double(std::size_t, std::size_t)>& step, const char* what) {
      EXPECT_TRUE(test::close(values, test::by_field(p.rows, g, cam, field, each, step), tolerance, p.rows.ids.empty()))
          << what;
    };
    compare(
        got.gradient.means, &Gaussians::means, 3, [](auto, auto) { return 0x1p-12; }, "means");
    compare(
        got.gradient.scales, &Gaussians::scales, 2, [&](auto k, auto j) { return 0x1p-7 * g.scales[2 * k + j]; },
        "scales");
    compare(
        got.gradient.quats, &Gaussians::quats, 4, [](auto, auto) { return 0x1p-12; }, "quats");
    compare(
        got.gradient.opacities, &Gaussians::opacities, 1, [&](auto k, auto) { return 0x1p-6 * g.opacities[k]; },
        "opacities");
    compare(
        got.gradient.sh, &Gaussians::sh, 3 * g.sh_count(), [](auto, auto) { return 0x1p-8; }, "sh");
    EXPECT_TRUE(test::close(got.pose, test::by_pose(p.rows, g, cam, 0x1p-12), tolerance, p.rows.ids.empty())) << "pose";
  }
};

TEST_P(ProjectSurfelsBackward, MatchesDifferences) {
  for (const test::SceneCase& c : test::scene_cases()) {
    if (c.kind == "near" || c.kind == "needles" || c.count > 1000) continue;
    for (const bool current : {false, true}) {
      SCOPED_TRACE(c.name + (current ? ", current" : ""));
      check(test::make_surfels(c, 31), test::make_camera(c, 31), {{}, current}, 1e-4);
    }
  }
}

TEST_P(ProjectSurfelsBackward, MirrorsTheCameraAndTakesQuaternionsOfAnyLength) {
  const test::SceneCase c{"", 60, 3, 64, 64, ""};
  Gaussians g = test::make_surfels(c, 33);
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t i = 0; i < 4; ++i) g.quats[4 * k + i] *= 0.5f + 0.03125f * static_cast<float>(k);
  ref::SurfelOptions options;
  options.options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  check(g, test::make_camera(c, 33), options, 1e-4);
}

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
