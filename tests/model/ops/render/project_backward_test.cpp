#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "model/ops/render/project.h"
#include "tests/support/compare.h"
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

  void check(const Gaussians& g, const Camera& cam, const ref::Options& options, double tolerance) {
    const Problem p = make(g, cam, options);
    const Result got = run(p);
    const auto compare = [&](const std::vector<float>& values, std::vector<float> Gaussians::*field, std::size_t each,
                             const std::function<double(std::size_t, std::size_t)>& step, const char* what) {
      EXPECT_TRUE(test::close(values, test::by_field(p.rows, g, cam, field, each, step), tolerance, p.rows.ids.empty()))
          << what;
    };
    const auto turn = [&](std::size_t k, std::size_t) {
      const float *q = &g.quats[4 * k], *s = &g.scales[3 * k];
      const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
      return length * (std::min({s[0], s[1], s[2]}) < 1e-3f ? 0x1p-10 : 0x1p-8);
    };
    compare(
        got.gradient.means, &Gaussians::means, 3, [](auto, auto) { return 0x1p-10; }, "means");
    compare(
        got.gradient.scales, &Gaussians::scales, 3, [&](auto k, auto j) { return 0x1p-6 * g.scales[3 * k + j]; },
        "scales");
    compare(got.gradient.quats, &Gaussians::quats, 4, turn, "quats");
    compare(
        got.gradient.opacities, &Gaussians::opacities, 1, [&](auto k, auto) { return 0x1p-6 * g.opacities[k]; },
        "opacities");
    compare(
        got.gradient.sh, &Gaussians::sh, 3 * g.sh_count(), [](auto, auto) { return 0x1p-8; }, "sh");
    EXPECT_TRUE(test::close(got.pose, test::by_pose(p.rows, g, cam, 1e-3), tolerance, p.rows.ids.empty())) << "pose";
  }
};

TEST_P(ProjectBackward, MatchesDifferences) {
  for (const test::SceneCase& c : test::scene_cases()) {
    SCOPED_TRACE(c.name);
    check(test::make_scene(c, 31), test::make_camera(c, 31), {}, 1e-4);
  }
}

TEST_P(ProjectBackward, MirrorsTheCameraForColours) {
  const test::SceneCase c{"", 100, 3, 64, 64, ""};
  ref::Options options;
  options.mirror = Eigen::Vector3d(0.5, -1, 0.25);
  check(test::make_scene(c, 32), test::make_camera(c, 32), options, 1e-4);
}

TEST_P(ProjectBackward, TakesQuaternionsOfAnyLength) {
  const test::SceneCase c{"", 60, 0, 64, 64, ""};
  Gaussians g = test::make_scene(c, 33);
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t i = 0; i < 4; ++i) g.quats[4 * k + i] *= 0.125f * static_cast<float>(1 + k);
  check(g, test::make_camera(c, 33), {}, 1e-4);
}

TEST_P(ProjectBackward, AddsToWhatIsThere) {
  const test::SceneCase c{"", 40, 1, 64, 64, ""};
  const Problem p = make(test::make_scene(c, 34), test::make_camera(c, 34), {});
  const Tensor views = upload_views(ctx(), {p.camera}, 0.2f, {});
  const DeviceGaussians g = upload(ctx(), p.g);
  const GaussianGradients out = zero_gradients(ctx(), g.count(), 1);
  const Device d = to_device(p.rows);
  const auto all = [&] {
    project_backward(ctx(), {g, 0, views, 0, false, d.visible, d.offsets, d.intersections, out, Tensor()});
    const Gaussians got = download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh});
    std::vector<float> values;
    for (const auto* v : {&got.means, &got.scales, &got.quats, &got.opacities, &got.sh})
      values.insert(values.end(), v->begin(), v->end());
    return values;
  };
  std::vector<float> once = all();
  for (float& v : once) v *= 2;
  EXPECT_EQ(all(), once);
}

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

// Sums of the rows that were written, into the scene's own Gaussians; what no pixel sees stays.
TEST_P(ProjectBackward, PullsAreSumsOfTouchedRows) {
  const std::vector<std::uint32_t> ids = {4, 0, 6}, offsets = {0, 3, 3, 5};
  const std::vector<std::uint8_t> touched = {1, 0, 1, 1, 1};
  std::vector<float> rows = test::random_floats(10, 1, 0, 1);
  rows[2] = rows[3] = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> pulls = test::random_floats(14, 2, 0, 1);
  ProjectPulls a;
  a.visible.ids = ctx().upload({3}, ids, Type::u32);
  a.offsets = ctx().upload({4}, offsets, Type::u32);
  a.intersections = {ctx().upload({5, 2}, rows), ctx().upload({5}, touched, Type::u8)};
  a.by_u = 3, a.by_v = 0.5;
  a.pulls = ctx().upload({7, 2}, pulls);
  project_pulls(ctx(), a);
  std::vector<double> want(pulls.begin(), pulls.end()), lengths;
  for (const std::size_t r : {0u, 2u}) want[8] += 3.0 * rows[2 * r], want[9] += 0.5 * rows[2 * r + 1];
  for (const std::size_t r : {3u, 4u}) want[12] += 3.0 * rows[2 * r], want[13] += 0.5 * rows[2 * r + 1];
  EXPECT_TRUE(test::close(ctx().read<float>(a.pulls), want, 1e-6));
  for (std::size_t k = 0; k < 7; ++k) lengths.push_back(std::hypot(want[2 * k], want[2 * k + 1]));
  EXPECT_TRUE(test::close(ctx().read<float>(pull_lengths(ctx(), a.pulls)), lengths, 1e-6));
  a.pulls = ctx().tensor({7, 3});
  EXPECT_THROW(project_pulls(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
