#include <gtest/gtest.h>

#include <cmath>

#include "model/ops/render/project.h"
#include "tests/support/device.h"
#include "tests/support/projection_rows.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class ProjectBackward : public test::FlavourTest {
 protected:
  struct Problem {
    Gaussians g;
    Camera camera;
    ref::Options options;
    test::ProjectionRows rows;
  };

  struct Result {
    Gaussians gradient;
    std::vector<float> pose;
  };

  static Problem make(const Gaussians& g, const Camera& cam, const ref::Options& options) {
    return {g, cam, options, test::volume_rows(g, cam, options)};
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
    d.visible.records = ctx().upload({n, 12}, p.records);
    d.offsets = ctx().upload({n + 1}, p.offsets, Type::u32);
    d.intersections = {ctx().upload({m, 10}, p.rows), ctx().upload({m}, p.touched, Type::u8)};
    return d;
  }

  Result run(const Problem& p) {
    std::optional<std::array<float, 3>> mirror;
    if (p.options.mirror)
      mirror = {static_cast<float>(p.options.mirror->x()), static_cast<float>(p.options.mirror->y()),
                static_cast<float>(p.options.mirror->z())};
    const Camera other = test::look_at({9, 9, 9}, {0, 0, 0}, {0, 1, 0}, 5, 5, 5);
    const Tensor views = upload_views(ctx(), {other, p.camera}, 0.2f, mirror);
    const DeviceGaussians g = upload(ctx(), p.g);
    const GaussianGradients out = zero_gradients(ctx(), g.count(), p.g.sh_degree);
    const Device d = to_device(p.rows);
    const Tensor twists = ctx().tensor({d.visible.ids.dim(0), 6});
    project_backward(ctx(), {g, 0, views, 1, mirror.has_value(), d.visible, d.offsets, d.intersections, out, twists});
    return {download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh}),
            ctx().read<float>(sum_twists(ctx(), twists))};
  }
};

TEST_P(ProjectBackward, TakesAChunkOfTheScene) {
  const test::SceneCase c{"", 50, 1, 64, 64, ""};
  const Problem p = make(test::make_scene(c, 36), test::make_camera(c, 36), {});
  const Result whole = run(p);
  const Tensor views = upload_views(ctx(), {p.camera}, 0.2f, {});
  const Device d = to_device(p.rows);
  const Tensor twists = ctx().tensor({d.visible.ids.dim(0), 6});
  std::vector<float> means;
  for (const auto& [base, size] : {std::pair<std::size_t, std::size_t>{0, 17}, {17, 33}}) {
    Gaussians part;
    part.count = size;
    part.sh_degree = 1;
    const auto cut = [b = base, n = size](const std::vector<float>& v, std::size_t each) {
      const auto at = v.begin() + static_cast<std::ptrdiff_t>(b * each);
      return std::vector<float>(at, at + static_cast<std::ptrdiff_t>(n * each));
    };
    part.means = cut(p.g.means, 3), part.scales = cut(p.g.scales, 3), part.quats = cut(p.g.quats, 4);
    part.opacities = cut(p.g.opacities, 1), part.sh = cut(p.g.sh, 12);
    const GaussianGradients out = zero_gradients(ctx(), static_cast<long>(size), 1);
    project_backward(ctx(), {upload(ctx(), part), static_cast<long>(base), views, 0, false, d.visible, d.offsets,
                             d.intersections, out, twists});
    const auto got = ctx().read<float>(out.means);
    means.insert(means.end(), got.begin(), got.end());
  }
  EXPECT_EQ(means, whole.gradient.means);
  EXPECT_EQ(ctx().read<float>(sum_twists(ctx(), twists)), whole.pose);
}

TEST_P(ProjectBackward, RejectsBadShape) {
  ProjectPulls pulls;
  pulls.visible.ids = ctx().tensor({3}, Type::u32), pulls.offsets = ctx().tensor({4}, Type::u32);
  pulls.intersections = {ctx().tensor({5, 2}), ctx().tensor({5}, Type::u8)};
  pulls.pulls = ctx().tensor({7, 3});
  EXPECT_THROW(project_pulls(ctx(), pulls), Error);
  const test::SceneCase c{"", 4, 1, 32, 32, ""};
  const DeviceGaussians g = upload(ctx(), test::make_scene(c, 35));
  GaussianGradients out = zero_gradients(ctx(), 4, 1);
  const Tensor views = upload_views(ctx(), {test::make_camera(c, 35)}, 0.2f, {});
  Device d;
  d.visible.ids = ctx().tensor({2}, Type::u32);
  d.visible.records = ctx().tensor({2, 12});
  d.offsets = ctx().tensor({3}, Type::u32);
  d.intersections = {ctx().tensor({7, 10}), ctx().tensor({7}, Type::u8)};
  const auto run_with = [&](long view, const Tensor& twists) {
    project_backward(ctx(), {g, 0, views, view, false, d.visible, d.offsets, d.intersections, out, twists});
  };
  EXPECT_THROW(run_with(1, Tensor()), Error);
  EXPECT_THROW(run_with(0, ctx().tensor({3, 6})), Error);
  d.offsets = ctx().tensor({2}, Type::u32);
  EXPECT_THROW(run_with(0, Tensor()), Error);
  d.offsets = ctx().tensor({3}, Type::u32);
  out.sh = ctx().tensor({4, 9, 3});
  EXPECT_THROW(run_with(0, Tensor()), Error);
}

VSPLAT_FLAVOURS(ProjectBackward);

}  // namespace
}  // namespace vsplat
