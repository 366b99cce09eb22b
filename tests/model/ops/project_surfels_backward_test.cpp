#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "model/ops/project_surfels.h"
#include "model/selftest/reference/surfels.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"
#include "tests/support/twist.h"

namespace vsplat {
namespace {

// A loss that is linear in a surfel's record: its derivatives, by the record's numbers. That by the opacity is by its
// logarithm to base e.
using ProjectSurfelsBackwardLoss = std::array<double, 20>;

double value_of(const ProjectSurfelsBackwardLoss& by, const ref::Surfel& s) {
  const std::array<double, 20> record = ref::record_of(s);
  double sum = 0;
  for (std::size_t i = 0; i < 20; ++i)
    if (by[i] != 0) sum += by[i] * (i == 2 ? std::log(2.0) : 1.0) * record[i];
  return sum;
}

class ProjectSurfelsBackward : public test::FlavourTest {
 protected:
  struct Problem {
    Gaussians g;
    Camera camera;
    ref::SurfelOptions options;
    std::vector<std::uint32_t> ids, offsets{0};
    std::vector<float> records, rows;
    std::vector<std::uint8_t> touched;
    std::vector<ProjectSurfelsBackwardLoss> losses;
  };

  // Rows at random, and the loss that they stand for. Each is split over up to four tiles.
  static Problem make(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& options) {
    Problem p{g, cam, options, {}, {0}, {}, {}, {}, {}};
    std::mt19937 engine(77);
    std::normal_distribution<double> normal;
    for (std::size_t k = 0; k < g.count; ++k) {
      const ref::Surfel s = ref::project_surfel(g, k, cam, options);
      if (s.culled || s.opacity < 1.0f / 255) continue;
      const std::array<double, 20> r = ref::record_of(s);
      // Off what floats know of a plane seen edge on or of a box that reaches to the camera's plane, and off colours'
      // limit.
      if (std::abs(s.facing) < 0.1 || std::hypot(r[10], r[11]) > 50 || s.colour.minCoeff() < 0.05) continue;
      p.ids.push_back(static_cast<std::uint32_t>(k));
      for (const double v : r) p.records.push_back(static_cast<float>(v));
      // Of the size that pictures make them: distances are of the size of 1 / m.
      const double m = std::sqrt(r[4] * r[4] + r[5] * r[5] + r[6] * r[6] + r[7] * r[7]), reach = 1 / m;
      std::array<double, 20> row{};
      const double sizes[] = {1, 1, 1, 1, reach, reach, reach, reach, reach, reach, 0.2, 0.2, 1, 1, 1, 1, 1, 1, 1, 0};
      for (std::size_t i = 0; i < 20; ++i) row[i] = sizes[i] * normal(engine);
      const std::size_t parts = 1 + engine() % 4;
      for (std::size_t part = 0; part < parts; ++part) {
        if (part == 1) {  // one that no pixel saw
          p.rows.resize(p.rows.size() + 20, std::numeric_limits<float>::quiet_NaN());
          p.touched.push_back(0);
        }
        for (const double v : row) p.rows.push_back(static_cast<float>(v / static_cast<double>(parts)));
        p.touched.push_back(1);
      }
      p.offsets.push_back(static_cast<std::uint32_t>(p.touched.size()));
      ProjectSurfelsBackwardLoss by{};
      by[0] = r[4] * row[1] + r[6] * row[2] + r[8] * row[3] + row[10];
      by[1] = r[5] * row[1] + r[7] * row[2] + r[9] * row[3] + row[11];
      by[2] = row[0];
      by[3] = row[12];
      for (std::size_t i = 4; i < 12; ++i) by[i] = row[i];
      for (std::size_t i = 0; i < 3; ++i) by[12 + i] = row[13 + i], by[16 + i] = row[16 + i];
      p.losses.push_back(by);
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
    const Device d = to_device(p);
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

  // Differences by each of a surfel's floats, which are changed to floats: the step taken is the one between those.
  static std::vector<double> differences(const Problem& p, std::vector<float> Gaussians::*field, std::size_t each,
                                         double relative) {
    Gaussians g = p.g;
    std::vector<double> out((g.*field).size(), 0.0);
    for (std::size_t i = 0; i < p.ids.size(); ++i) {
      const float* s = &p.g.scales[2 * std::size_t{p.ids[i]}];
      for (std::size_t j = 0; j < each; ++j) {
        const std::size_t at = p.ids[i] * each + j;
        float& value = (g.*field)[at];
        const float base = value;
        const auto slope = [&](double h) {
          const float low = base - static_cast<float>(h), high = base + static_cast<float>(h);
          value = high;
          const double f = value_of(p.losses[i], ref::project_surfel(g, p.ids[i], p.camera, p.options));
          value = low;
          const double b = value_of(p.losses[i], ref::project_surfel(g, p.ids[i], p.camera, p.options));
          value = base;
          return (f - b) / (static_cast<double>(high) - low);
        };
        const double size = field == &Gaussians::scales ? s[j] : field == &Gaussians::opacities ? base : 1.0;
        const double h = relative * size;
        out[at] = (4 * slope(h / 2) - slope(h)) / 3;
      }
    }
    return out;
  }

  void check(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& options, double tolerance) {
    const Problem p = make(g, cam, options);
    const Result got = run(p, static_cast<long>(std::max<std::size_t>(g.count, 1)));
    const bool none = p.ids.empty();
    const auto compare = [&](const std::vector<float>& values, std::vector<float> Gaussians::*field, std::size_t each,
                             double step, const char* what) {
      EXPECT_TRUE(test::close(values, differences(p, field, each, step), tolerance, none)) << what;
    };
    compare(got.gradient.means, &Gaussians::means, 3, 0x1p-12, "means");
    compare(got.gradient.scales, &Gaussians::scales, 2, 0x1p-7, "scales");
    compare(got.gradient.quats, &Gaussians::quats, 4, 0x1p-12, "quats");
    compare(got.gradient.opacities, &Gaussians::opacities, 1, 0x1p-6, "opacities");
    compare(got.gradient.sh, &Gaussians::sh, 3 * g.sh_count(), 0x1p-8, "sh");
    std::vector<double> pose(6);
    for (std::size_t i = 0; i < 6; ++i) {
      const auto loss = [&](double h) {
        Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
        twist[static_cast<Eigen::Index>(i)] = h;
        Camera moved = cam;
        moved.w2c = test::exp_twist(twist) * cam.w2c;
        double sum = 0;
        for (std::size_t n = 0; n < p.ids.size(); ++n)
          sum += value_of(p.losses[n], ref::project_surfel(g, p.ids[n], moved, options));
        return sum;
      };
      const auto slope = [&](double h) { return (loss(h) - loss(-h)) / (2 * h); };
      pose[i] = (4 * slope(0x1p-13) - slope(0x1p-12)) / 3;
    }
    EXPECT_TRUE(test::close(got.pose, pose, tolerance, none)) << "pose";
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
