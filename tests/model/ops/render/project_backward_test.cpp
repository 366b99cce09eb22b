#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/projection_rows.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/ops/render/project.h"
#include "model/ops/render/project_surfels.h"
#include "tests/support/device.h"
#include "tests/support/gaussian_gradients.h"

namespace vsplat {
namespace {

using selftest::ProjectionRows;
using selftest::SceneCase;

constexpr GaussianKind kKinds[] = {GaussianKind::volume, GaussianKind::surfel};

Gaussians scene_of(GaussianKind kind, const SceneCase& c, std::uint32_t seed) {
  return kind == GaussianKind::surfel ? selftest::make_surfels(c, seed) : selftest::make_scene(c, seed);
}

class ProjectBackward : public test::FlavourTest {
 protected:
  struct Device {
    Projected visible;
    Tensor offsets;
    IntersectionGradients intersections;
  };

  static long record_of(GaussianKind kind) { return kind == GaussianKind::surfel ? kSurfelRecord : kRecord; }
  static long row_of(GaussianKind kind) { return kind == GaussianKind::surfel ? 20 : 10; }

  Device to_device(GaussianKind kind, const ProjectionRows& p) {
    const long n = static_cast<long>(p.ids.size()), m = static_cast<long>(p.touched.size());
    Device d;
    d.visible.ids = ctx().upload({n}, p.ids, Type::u32);
    d.visible.records = ctx().upload({n, record_of(kind)}, p.records);
    d.offsets = ctx().upload({n + 1}, p.offsets, Type::u32);
    d.intersections = {ctx().upload({m, row_of(kind)}, p.rows), ctx().upload({m}, p.touched, Type::u8)};
    return d;
  }

  void run(GaussianKind kind, const DeviceGaussians& g, long base, const Tensor& views, long view, const Device& d,
           const GaussianGradients& out, const Tensor& pose_gradients) {
    if (kind == GaussianKind::surfel)
      project_surfels_backward(
          ctx(), {g, base, views, view, false, d.visible, d.offsets, d.intersections, out, pose_gradients});
    else
      project_backward(ctx(),
                       {g, base, views, view, false, d.visible, d.offsets, d.intersections, out, pose_gradients});
  }

  struct Result {
    Gaussians gradient;
    std::vector<float> pose;
  };

  // The Gaussians in chunks of so many.
  Result run_in_chunks(const Gaussians& g, const Camera& cam, const ProjectionRows& rows, long chunk) {
    const Camera other = selftest::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
    const Tensor views = upload_views(ctx(), {other, cam}, 0.2f, {});
    const Device d = to_device(g.kind, rows);
    const Tensor pose_gradients = ctx().tensor({d.visible.ids.dim(0), 6});
    Result result;
    const auto count = static_cast<long>(g.count);
    for (long base = 0; base < count; base += chunk) {
      const long n = std::min(chunk, count - base);
      const GaussianGradients out = zero_gradients(ctx(), n, g.sh_degree, g.kind);
      run(g.kind, upload(ctx(), g, base, n), base, views, 1, d, out, pose_gradients);
      const Gaussians part = download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh});
      for (const auto& [name, values] : test::kGaussianFields) {
        std::vector<float>& to = result.gradient.*values;
        to.insert(to.end(), (part.*values).begin(), (part.*values).end());
      }
    }
    result.pose = ctx().read<float>(sum_pose_gradients(ctx(), pose_gradients));
    return result;
  }
};

TEST_P(ProjectBackward, TakesTheSceneInChunks) {
  const SceneCase c{"", 50, 1, 64, 64, ""};
  const Camera cam = selftest::make_camera(c, 36);
  for (const GaussianKind kind : kKinds) {
    const Gaussians g = scene_of(kind, c, 36);
    const ProjectionRows rows =
        kind == GaussianKind::surfel ? selftest::surfel_rows(g, cam, {}) : selftest::volume_rows(g, cam, {});
    const Result whole = run_in_chunks(g, cam, rows, 50), parts = run_in_chunks(g, cam, rows, 17);
    test::expect_same(parts.gradient, whole.gradient);
    EXPECT_EQ(parts.pose, whole.pose);
  }
}

TEST_P(ProjectBackward, RejectsBadShape) {
  const SceneCase c{"", 4, 1, 32, 32, ""};
  const Tensor views = upload_views(ctx(), {selftest::make_camera(c, 35)}, 0.2f, {});
  for (const GaussianKind kind : kKinds) {
    const DeviceGaussians g = upload(ctx(), scene_of(kind, c, 35));
    GaussianGradients out = zero_gradients(ctx(), 4, 1, kind);
    Device d;
    d.visible.ids = ctx().tensor({2}, Type::u32);
    d.visible.records = ctx().tensor({2, record_of(kind)});
    d.offsets = ctx().tensor({3}, Type::u32);
    d.intersections = {ctx().tensor({7, row_of(kind)}), ctx().tensor({7}, Type::u8)};
    const auto run_with = [&](long view, const Tensor& pose_gradients) {
      run(kind, g, 0, views, view, d, out, pose_gradients);
    };
    EXPECT_THROW(run_with(1, Tensor()), Error);
    EXPECT_THROW(run_with(0, ctx().tensor({3, 6})), Error);
    d.offsets = ctx().tensor({2}, Type::u32);
    EXPECT_THROW(run_with(0, Tensor()), Error);
    d.offsets = ctx().tensor({3}, Type::u32);
    if (kind == GaussianKind::surfel)
      out.scales = ctx().tensor({4, 3});
    else
      out.sh = ctx().tensor({4, 9, 3});
    EXPECT_THROW(run_with(0, Tensor()), Error);
  }
}

TEST_P(ProjectBackward, RejectsBadShapesOfPulls) {
  ProjectPulls pulls;
  pulls.visible.ids = ctx().tensor({3}, Type::u32), pulls.offsets = ctx().tensor({4}, Type::u32);
  pulls.intersections = {ctx().tensor({5, 2}), ctx().tensor({5}, Type::u8)};
  pulls.pulls = ctx().tensor({7, 3});
  EXPECT_THROW(project_pulls(ctx(), pulls), Error);
}

VSPLAT_FLAVOURS(ProjectBackward);

}  // namespace
}  // namespace vsplat
