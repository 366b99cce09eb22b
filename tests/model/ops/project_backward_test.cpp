#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "model/ops/project.h"
#include "model/selftest/reference/splat.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"
#include "tests/support/twist.h"

namespace vsplat {
namespace {

// A loss that is linear in what projection makes of one Gaussian: its derivatives.
struct ProjectBackwardLoss {
  double by_u, by_v, by_z, by_a, by_b, by_c, by_log_opacity;
  Eigen::Vector3d by_colour;

  double operator()(const ref::Splat& s) const {
    return by_u * s.u + by_v * s.v + by_z * s.z + by_a * s.a + by_b * s.b + by_c * s.c +
           by_log_opacity * std::log(s.opacity) + by_colour.dot(s.colour);
  }
};

// By central differences of fourth order: f(0) is not evaluated.
double derivative(const std::function<double(double)>& f, double step) {
  const auto slope = [&](double h) { return (f(h) - f(-h)) / (2 * h); };
  return (4 * slope(step / 2) - slope(step)) / 3;
}

class ProjectBackward : public test::FlavourTest {
 protected:
  struct Problem {
    Gaussians g;
    Camera camera;
    ref::Options options;
    std::vector<std::uint32_t> ids, offsets{0};
    std::vector<float> records, rows;
    std::vector<std::uint8_t> touched;
    std::vector<ProjectBackwardLoss> losses;
  };

  struct Result {
    Gaussians gradient;
    std::vector<float> pose;
  };

  // Far enough from the limits of the Jacobian and of colour for differences to stay on one side.
  static bool smooth(const ref::Splat& s, const Camera& cam) {
    const double x = (s.u - cam.cx) / cam.fx, y = (s.v - cam.cy) / cam.fy;
    const double lx = 1.3 * cam.width / (2 * cam.fx), ly = 1.3 * cam.height / (2 * cam.fy);
    const bool colour_clear = s.colour.minCoeff() > 0.05;
    return std::abs(std::abs(x) / lx - 1) > 0.05 && std::abs(std::abs(y) / ly - 1) > 0.05 && colour_clear;
  }

  static Problem make(const Gaussians& g, const Camera& cam, const ref::Options& options) {
    Problem p{g, cam, options, {}, {0}, {}, {}, {}, {}};
    std::mt19937 engine(77);
    std::normal_distribution<double> normal;
    const double log2e = 1 / std::log(2.0);
    for (std::size_t k = 0; k < g.count; ++k) {
      const ref::Splat s = ref::project(g, k, cam, options);
      if (s.culled || s.opacity < 1.0f / 255 || !smooth(s, cam)) continue;
      p.ids.push_back(static_cast<std::uint32_t>(k));
      const double det = s.a * s.c - s.b * s.b, X = 1 / s.a, Y = s.a / det, slope = s.b / s.a;
      for (const double v : {s.u, s.v, 0.0, s.z, std::log2(s.opacity), slope, -0.5 * log2e * X, -0.5 * log2e * Y,
                             s.colour[0], s.colour[1], s.colour[2], 0.0})
        p.records.push_back(static_cast<float>(v));
      // Derivatives of the size that pictures make them: p is of the size of one over the smaller radius.
      const double n[] = {normal(engine), normal(engine), normal(engine)};
      ProjectBackwardLoss loss{n[0] / std::sqrt(s.a),
                               n[1] / std::sqrt(s.c),
                               normal(engine),
                               n[0] * n[0] / s.a,
                               n[0] * n[1] / std::sqrt(s.a * s.c),
                               n[1] * n[1] / s.c,
                               normal(engine),
                               {normal(engine), normal(engine), normal(engine)}};
      // The sums of cl/rasterize_backward.cl from which these come: of h (1, dx, t, dx^2, dx t, t^2).
      const double py = -loss.by_v, px = -loss.by_u, pyy = 2 * loss.by_c, pxy = loss.by_b, pxx = 2 * loss.by_a;
      const double mxt = (pxy + slope * pyy) / (X * Y), mtt = pyy / (Y * Y);
      const double mxx = (pxx + 2 * slope * X * Y * mxt - slope * slope * Y * Y * mtt) / (X * X);
      const std::vector<double> sums = {
          loss.by_log_opacity, (px + slope * py) / X, py / Y,   mxx, mxt, mtt, loss.by_colour[0],
          loss.by_colour[1],   loss.by_colour[2],     loss.by_z};
      const std::size_t parts = 1 + engine() % 4;
      for (std::size_t part = 0; part < parts; ++part) {
        if (part == 1) {  // one that no pixel saw
          p.rows.resize(p.rows.size() + 10, std::numeric_limits<float>::quiet_NaN());
          p.touched.push_back(0);
        }
        for (const double v : sums) p.rows.push_back(static_cast<float>(v / static_cast<double>(parts)));
        p.touched.push_back(1);
      }
      p.offsets.push_back(static_cast<std::uint32_t>(p.touched.size()));
      p.losses.push_back(loss);
    }
    return p;
  }

  struct Device {
    Projected visible;
    Tensor offsets;
    IntersectionGradients intersections;
  };

  Device to_device(const Problem& p) {
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
    const Device d = to_device(p);
    const Tensor twists = ctx().tensor({d.visible.ids.dim(0), 6});
    project_backward(ctx(), {g, 0, views, 1, mirror.has_value(), d.visible, d.offsets, d.intersections, out, twists});
    return {download(ctx(), DeviceGaussians{out.means, out.scales, out.quats, out.opacities, out.sh}),
            ctx().read<float>(sum_twists(ctx(), twists))};
  }

  // Differences by each of a Gaussian's floats, which are changed to floats: the step taken is the one between those.
  static std::vector<double> differences(const Problem& p, std::vector<float> Gaussians::*field, std::size_t each,
                                         const std::function<double(std::size_t, std::size_t)>& step) {
    Gaussians g = p.g;
    std::vector<double> out((g.*field).size(), 0.0);
    for (std::size_t i = 0; i < p.ids.size(); ++i) {
      for (std::size_t j = 0; j < each; ++j) {
        const std::size_t at = p.ids[i] * each + j;
        float& value = (g.*field)[at];
        const float base = value;
        const auto slope = [&](double h) {
          const float low = base - static_cast<float>(h), high = base + static_cast<float>(h);
          value = high;
          const double f = p.losses[i](ref::project(g, p.ids[i], p.camera, p.options));
          value = low;
          const double b = p.losses[i](ref::project(g, p.ids[i], p.camera, p.options));
          value = base;
          return (f - b) / (static_cast<double>(high) - low);
        };
        const double h = step(p.ids[i], j);
        out[at] = (4 * slope(h / 2) - slope(h)) / 3;
      }
    }
    return out;
  }

  void check(const Gaussians& g, const Camera& cam, const ref::Options& options, double tolerance) {
    const Problem p = make(g, cam, options);
    const Result got = run(p);
    const auto smallest = [&](std::size_t k) {
      return static_cast<double>(std::min({g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]}));
    };
    const bool none = p.ids.empty();
    EXPECT_TRUE(test::close(got.gradient.means,
                            differences(p, &Gaussians::means, 3, [&](auto, auto) { return 0x1p-10; }), tolerance, none))
        << "means";
    EXPECT_TRUE(
        test::close(got.gradient.scales,
                    differences(p, &Gaussians::scales, 3, [&](auto k, auto j) { return 0x1p-6 * g.scales[3 * k + j]; }),
                    tolerance, none))
        << "scales";
    EXPECT_TRUE(test::close(got.gradient.quats,
                            differences(p, &Gaussians::quats, 4,
                                        [&](auto k, auto) {
                                          const float* q = &g.quats[4 * k];
                                          const double length =
                                              std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
                                          return length * (smallest(k) < 1e-3 ? 0x1p-10 : 0x1p-8);
                                        }),
                            tolerance, none))
        << "quats";
    EXPECT_TRUE(
        test::close(got.gradient.opacities,
                    differences(p, &Gaussians::opacities, 1, [&](auto k, auto) { return 0x1p-6 * g.opacities[k]; }),
                    tolerance, none))
        << "opacities";
    EXPECT_TRUE(test::close(got.gradient.sh,
                            differences(p, &Gaussians::sh, 3 * g.sh_count(), [](auto, auto) { return 0x1p-8; }),
                            tolerance, none))
        << "sh";
    std::vector<double> pose(6);
    for (std::size_t i = 0; i < 6; ++i) {
      pose[i] = derivative(
          [&](double h) {
            Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
            twist[static_cast<Eigen::Index>(i)] = h;
            Camera moved = cam;
            moved.w2c = test::exp_twist(twist) * cam.w2c;
            double sum = 0;
            for (std::size_t n = 0; n < p.ids.size(); ++n)
              sum += p.losses[n](ref::project(g, p.ids[n], moved, options));
            return sum;
          },
          1e-3);
    }
    EXPECT_TRUE(test::close(got.pose, pose, tolerance, none)) << "pose";
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
  const Device d = to_device(p);
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
  const Device d = to_device(p);
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
