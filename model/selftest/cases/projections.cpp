// Projection's derivatives, of volumes and of surfels: rows of sums that stand for a loss which is linear in what
// projection makes of each Gaussian, against differences of that loss.
#include <functional>

#include "model/ops/project.h"
#include "model/ops/project_surfels.h"
#include "model/selftest/cases/cases.h"
#include "model/selftest/inputs/scenes.h"
#include "model/selftest/inputs/twist.h"
#include "model/selftest/reference/splat.h"
#include "model/selftest/reference/surfels.h"

namespace vsplat::selftest {
namespace {

struct Rows {
  std::vector<std::uint32_t> ids, offsets{0};
  std::vector<float> records, rows;
  std::vector<std::uint8_t> touched;
  // Of Gaussian ids[i], as given, in a camera as given.
  std::vector<std::function<double(const Gaussians&, const Camera&)>> losses;

  // Split over up to four tiles, beside one that no pixel saw.
  void add(const std::vector<double>& sums, std::mt19937& engine) {
    const std::size_t parts = 1 + engine() % 4;
    for (std::size_t part = 0; part < parts; ++part) {
      if (part == 1) {
        rows.resize(rows.size() + sums.size(), NAN);
        touched.push_back(0);
      }
      for (const double v : sums) rows.push_back(static_cast<float>(v / static_cast<double>(parts)));
      touched.push_back(1);
    }
    offsets.push_back(static_cast<std::uint32_t>(touched.size()));
  }
};

// Off the limits of the Jacobian and of colour, so that differences stay on one side.
bool is_smooth(const ref::Splat& s, const Camera& cam) {
  const double x = (s.u - cam.cx) / cam.fx, y = (s.v - cam.cy) / cam.fy;
  const double lx = 1.3 * cam.width / (2 * cam.fx), ly = 1.3 * cam.height / (2 * cam.fy);
  return std::abs(std::abs(x) / lx - 1) > 0.05 && std::abs(std::abs(y) / ly - 1) > 0.05 && s.colour.minCoeff() > 0.05;
}

Rows volume_rows(const Gaussians& g, const Camera& cam) {
  Rows p;
  std::mt19937 engine(77);
  std::normal_distribution<double> normal;
  const double log2e = 1 / std::log(2.0);
  for (std::size_t k = 0; k < g.count; ++k) {
    const ref::Splat s = ref::project(g, k, cam, {});
    if (s.culled || s.opacity < 1.0f / 255 || !is_smooth(s, cam)) continue;
    p.ids.push_back(static_cast<std::uint32_t>(k));
    const double X = 1 / s.a, Y = s.a / (s.a * s.c - s.b * s.b), slope = s.b / s.a;
    for (const double v : {s.u, s.v, 0.0, s.z, std::log2(s.opacity), slope, -0.5 * log2e * X, -0.5 * log2e * Y,
                           s.colour[0], s.colour[1], s.colour[2], 0.0})
      p.records.push_back(static_cast<float>(v));
    // Of the size that pictures make them.
    const double n[] = {normal(engine), normal(engine), normal(engine)};
    const double by_u = n[0] / std::sqrt(s.a), by_v = n[1] / std::sqrt(s.c), by_z = n[2], by_a = n[0] * n[0] / s.a,
                 by_b = n[0] * n[1] / std::sqrt(s.a * s.c), by_c = n[1] * n[1] / s.c, by_opacity = normal(engine);
    const Eigen::Vector3d by_colour(normal(engine), normal(engine), normal(engine));
    // The sums of cl/rasterize_backward.cl from which these come: of h (1, dx, t, dx^2, dx t, t^2).
    const double py = -by_v, px = -by_u, pyy = 2 * by_c, pxx = 2 * by_a;
    const double mxt = (by_b + slope * pyy) / (X * Y), mtt = pyy / (Y * Y);
    const double mxx = (pxx + 2 * slope * X * Y * mxt - slope * slope * Y * Y * mtt) / (X * X);
    p.add({by_opacity, (px + slope * py) / X, py / Y, mxx, mxt, mtt, by_colour[0], by_colour[1], by_colour[2], by_z},
          engine);
    p.losses.emplace_back([=](const Gaussians& moved, const Camera& from) {
      const ref::Splat at = ref::project(moved, k, from, {});
      return by_u * at.u + by_v * at.v + by_z * at.z + by_a * at.a + by_b * at.b + by_c * at.c +
             by_opacity * std::log(at.opacity) + by_colour.dot(at.colour);
    });
  }
  return p;
}

Rows surfel_rows(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& o) {
  Rows p;
  std::mt19937 engine(77);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < g.count; ++k) {
    const ref::Surfel s = ref::project_surfel(g, k, cam, o);
    if (s.culled || s.opacity < 1.0f / 255) continue;
    const std::array<double, 20> r = ref::record_of(s);
    // Off what floats know of a plane seen edge on or of a box that reaches to the camera's plane, and off colours'
    // limit.
    if (std::abs(s.facing) < 0.1 || std::hypot(r[10], r[11]) > 50 || s.colour.minCoeff() < 0.05) continue;
    p.ids.push_back(static_cast<std::uint32_t>(k));
    for (const double v : r) p.records.push_back(static_cast<float>(v));
    const double reach = 1 / std::sqrt(r[4] * r[4] + r[5] * r[5] + r[6] * r[6] + r[7] * r[7]);
    std::vector<double> row;
    for (const double size : {1.0, 1.0, 1.0, 1.0, reach, reach, reach, reach, reach, reach,
                              0.2, 0.2, 1.0, 1.0, 1.0,   1.0,   1.0,   1.0,   1.0,   0.0})
      row.push_back(size * normal(engine));
    p.add(row, engine);
    std::array<double, 20> by{};
    by[0] = r[4] * row[1] + r[6] * row[2] + r[8] * row[3] + row[10];
    by[1] = r[5] * row[1] + r[7] * row[2] + r[9] * row[3] + row[11];
    by[2] = row[0] * std::log(2.0);
    by[3] = row[12];
    for (std::size_t i = 4; i < 12; ++i) by[i] = row[i];
    for (std::size_t i = 0; i < 3; ++i) by[12 + i] = row[13 + i], by[16 + i] = row[16 + i];
    p.losses.emplace_back([=](const Gaussians& moved, const Camera& from) {
      const auto record = ref::record_of(ref::project_surfel(moved, k, from, o));
      double sum = 0;
      for (std::size_t i = 0; i < 20; ++i)
        if (by[i] != 0) sum += by[i] * record[i];
      return sum;
    });
  }
  return p;
}

// Differences by each of a Gaussian's floats, which are changed to floats: the step taken is the one between those.
std::vector<double> by_field(const Rows& p, const Gaussians& given, const Camera& cam,
                             std::vector<float> Gaussians::*field, std::size_t each,
                             const std::function<double(std::size_t, std::size_t)>& step) {
  Gaussians g = given;
  std::vector<double> out((g.*field).size(), 0.0);
  for (std::size_t i = 0; i < p.ids.size(); ++i)
    for (std::size_t j = 0; j < each; ++j) {
      const std::size_t at = p.ids[i] * each + j;
      float& value = (g.*field)[at];
      const float base = value;
      const auto slope = [&](double h) {
        const float low = base - static_cast<float>(h), high = base + static_cast<float>(h);
        value = high;
        const double f = p.losses[i](g, cam);
        value = low;
        const double b = p.losses[i](g, cam);
        value = base;
        return (f - b) / (static_cast<double>(high) - low);
      };
      const double h = step(p.ids[i], j);
      out[at] = (4 * slope(h / 2) - slope(h)) / 3;
    }
  return out;
}

std::vector<double> by_pose(const Rows& p, const Gaussians& g, const Camera& cam, double step) {
  std::vector<double> out;
  for (Eigen::Index i = 0; i < 6; ++i) {
    const auto loss = [&](double h) {
      Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
      twist[i] = h;
      Camera moved = cam;
      moved.w2c = exp_twist(twist) * cam.w2c;
      double sum = 0;
      for (const auto& one : p.losses) sum += one(g, moved);
      return sum;
    };
    const auto slope = [&](double h) { return (loss(h) - loss(-h)) / (2 * h); };
    out.push_back((4 * slope(step / 2) - slope(step)) / 3);
  }
  return out;
}

void check_projection(Checks& c, const Gaussians& g, const Camera& cam,
                      const std::optional<ref::SurfelOptions>& surfels) {
  const Rows p = surfels ? surfel_rows(g, cam, *surfels) : volume_rows(g, cam);
  if (p.ids.empty()) return;
  const long n = static_cast<long>(p.ids.size()), m = static_cast<long>(p.touched.size()), record = surfels ? 20 : 12,
             columns = surfels ? 20 : 10;
  const Tensor views = upload_views(c.ctx, {cam}, 0.2f, {}), twists = c.gap({n, 6});
  const DeviceGaussians d = upload(c.ctx, g);
  const GaussianGradients out = zero_gradients(c.ctx, d.count(), g.sh_degree, g.kind);
  Projected visible;
  visible.ids = c.up({n}, p.ids), visible.records = c.up({n, record}, p.records);
  const Tensor offsets = c.up({n + 1}, p.offsets);
  const IntersectionGradients rows{c.up({m, columns}, p.rows), c.ctx.upload({m}, p.touched, Type::u8)};
  if (surfels)
    project_surfels_backward(c.ctx, {d, 0, views, 0, false, visible, offsets, rows, out, twists,
                                     surfels->current ? SurfelRevision::current : SurfelRevision::lara});
  else
    project_backward(c.ctx, {d, 0, views, 0, false, visible, offsets, rows, out, twists});
  const std::size_t scales = surfels ? 2 : 3;
  const auto smallest = [&](std::size_t k) {
    return std::min({g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]});
  };
  const auto step_of = [](double step) { return [step](std::size_t, std::size_t) { return step; }; };
  c.close(
      "means", out.means,
      [&] { return by_field(p, g, cam, &Gaussians::means, 3, step_of(surfels ? 0x1p-12 : 0x1p-10)); }, 1e-4);
  c.close(
      "scales", out.scales,
      [&] {
        return by_field(p, g, cam, &Gaussians::scales, scales, [&](std::size_t k, std::size_t j) {
          return (surfels ? 0x1p-7 : 0x1p-6) * static_cast<double>(g.scales[scales * k + j]);
        });
      },
      1e-4);
  c.close(
      "rotations", out.quats,
      [&] {
        return by_field(p, g, cam, &Gaussians::quats, 4, [&](std::size_t k, std::size_t) {
          return surfels ? 0x1p-12 : smallest(k) < 1e-3f ? 0x1p-10 : 0x1p-8;
        });
      },
      1e-4);
  c.close(
      "opacities", out.opacities,
      [&] {
        return by_field(p, g, cam, &Gaussians::opacities, 1,
                        [&](std::size_t k, std::size_t) { return 0x1p-6 * static_cast<double>(g.opacities[k]); });
      },
      1e-4);
  c.close(
      "harmonics", out.sh, [&] { return by_field(p, g, cam, &Gaussians::sh, 3 * g.sh_count(), step_of(0x1p-8)); },
      1e-4);
  c.close(
      "pose", sum_twists(c.ctx, twists), [&] { return by_pose(p, g, cam, surfels ? 0x1p-12 : 1e-3); }, 1e-4);
}

void project_backward_all(Checks& c) {
  for (const SceneCase& s : {SceneCase{"", 17, 1, 50, 37, ""},
                             {"", 120, 3, 64, 48, ""},
                             {"", 65, 2, 61, 97, "off-centre"},
                             {"", 63, 0, 96, 96, "needles"}})
    if (!c.quick || s.count < 70) check_projection(c, make_scene(s, 31), make_camera(s, 31), {});
  // Sums of the rows that were written, into the scene's own Gaussians; what no pixel sees stays.
  const std::vector<std::uint32_t> ids = {4, 0, 6}, offsets = {0, 3, 3, 5};
  std::vector<float> rows = random_floats(10, 1, 0, 1);
  rows[2] = rows[3] = NAN;
  const auto before = random_floats(14, 2, 0, 1);
  ProjectPulls a;
  a.visible.ids = c.up({3}, ids), a.offsets = c.up({4}, offsets);
  a.intersections = {c.up({5, 2}, rows), c.ctx.upload({5}, std::vector<std::uint8_t>{1, 0, 1, 1, 1}, Type::u8)};
  a.by_u = 3, a.by_v = 0.5, a.pulls = c.up({7, 2}, before);
  project_pulls(c.ctx, a);
  std::vector<double> want(before.begin(), before.end()), lengths;
  for (const std::size_t r : {0u, 2u}) want[8] += 3.0 * rows[2 * r], want[9] += 0.5 * rows[2 * r + 1];
  for (const std::size_t r : {3u, 4u}) want[12] += 3.0 * rows[2 * r], want[13] += 0.5 * rows[2 * r + 1];
  c.close("pulls", a.pulls, want, 1e-6);
  for (std::size_t k = 0; k < 7; ++k) lengths.push_back(std::hypot(want[2 * k], want[2 * k + 1]));
  c.close("lengths of pulls", pull_lengths(c.ctx, a.pulls), lengths, 1e-6);
}

void project_surfels_backward_all(Checks& c) {
  for (const bool current : {false, true})
    for (const SceneCase& s : {SceneCase{"", 17, 1, 50, 37, ""}, {"", 65, 3, 64, 48, ""}})
      check_projection(c, make_surfels(s, 31), make_camera(s, 31), ref::SurfelOptions{{}, current});
}

}  // namespace

std::vector<Case> projection_cases() {
  return {{"project_backward", project_backward_all}, {"project_surfels_backward", project_surfels_backward_all}};
}

}  // namespace vsplat::selftest
