// Sums of what pixels say of Gaussians that stand for a loss which is linear in what projection makes of each, and
// that loss's derivatives by differences.
#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "model/diagnose/selftest/inputs/se3.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/diagnose/selftest/reference/surfels.h"

namespace vsplat::selftest {

struct ProjectionRows {
  std::vector<std::uint32_t> ids, offsets{0};
  std::vector<float> records, rows;
  std::vector<std::uint8_t> touched;
  // The derivatives for Gaussian ids[i], as given, in a camera as given.
  std::vector<std::function<double(const Gaussians&, const Camera&)>> losses;

  // Split over up to four tiles, beside one that no pixel saw.
  void add(const std::vector<double>& sums, std::mt19937& engine) {
    const std::size_t parts = 1 + engine() % 4;
    for (std::size_t part = 0; part < parts; ++part) {
      if (part == 1) {
        rows.resize(rows.size() + sums.size(), std::numeric_limits<float>::quiet_NaN());
        touched.push_back(0);
      }
      for (const double v : sums) rows.push_back(static_cast<float>(v / static_cast<double>(parts)));
      touched.push_back(1);
    }
    offsets.push_back(static_cast<std::uint32_t>(touched.size()));
  }
};

// The sums for volumes. Gaussians near the limits of the Jacobian and of colour are left out, so that differences stay
// on one side.
inline ProjectionRows volume_rows(const Gaussians& g, const Camera& cam, const ref::Options& options) {
  const auto is_smooth = [&](const ref::Splat& s) {
    const double x = (s.u - cam.cx) / cam.fx, y = (s.v - cam.cy) / cam.fy;
    const double lx = 1.3 * cam.width / (2 * cam.fx), ly = 1.3 * cam.height / (2 * cam.fy);
    return std::abs(std::abs(x) / lx - 1) > 0.05 && std::abs(std::abs(y) / ly - 1) > 0.05 && s.colour.minCoeff() > 0.05;
  };
  ProjectionRows p;
  std::mt19937 engine(77);
  std::normal_distribution<double> normal;
  const double log2e = 1 / std::log(2.0);
  for (std::size_t k = 0; k < g.count; ++k) {
    const ref::Splat s = ref::project(g, k, cam, options);
    if (s.culled || s.opacity < 1.0f / 255 || !is_smooth(s)) continue;
    p.ids.push_back(static_cast<std::uint32_t>(k));
    const double X = 1 / s.a, Y = s.a / (s.a * s.c - s.b * s.b), slope = s.b / s.a;
    for (const double v : {s.u, s.v, 0.0, s.z, std::log2(s.opacity), slope, -0.5 * log2e * X, -0.5 * log2e * Y,
                           s.colour[0], s.colour[1], s.colour[2], 0.0})
      p.records.push_back(static_cast<float>(v));
    // Magnitudes as pictures give them: by the position, one over the smaller radius.
    const double n[] = {normal(engine), normal(engine), normal(engine)};
    const double by_u = n[0] / std::sqrt(s.a), by_v = n[1] / std::sqrt(s.c), by_z = n[2], by_a = n[0] * n[0] / s.a,
                 by_b = n[0] * n[1] / std::sqrt(s.a * s.c), by_c = n[1] * n[1] / s.c, by_opacity = normal(engine);
    const Eigen::Vector3d by_colour(normal(engine), normal(engine), normal(engine));
    // The sums of cl/render/rasterize_backward.cl from which these come: of h (1, dx, t, dx^2, dx t, t^2).
    const double py = -by_v, px = -by_u, pyy = 2 * by_c, pxx = 2 * by_a;
    const double mxt = (by_b + slope * pyy) / (X * Y), mtt = pyy / (Y * Y);
    const double mxx = (pxx + 2 * slope * X * Y * mxt - slope * slope * Y * Y * mtt) / (X * X);
    p.add({by_opacity, (px + slope * py) / X, py / Y, mxx, mxt, mtt, by_colour[0], by_colour[1], by_colour[2], by_z},
          engine);
    p.losses.emplace_back([=](const Gaussians& moved, const Camera& from) {
      const ref::Splat at = ref::project(moved, k, from, options);
      return by_u * at.u + by_v * at.v + by_z * at.z + by_a * at.a + by_b * at.b + by_c * at.c +
             by_opacity * std::log(at.opacity) + by_colour.dot(at.colour);
    });
  }
  return p;
}

inline ProjectionRows surfel_rows(const Gaussians& g, const Camera& cam, const ref::SurfelOptions& options) {
  ProjectionRows p;
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
    // As large as pictures make them: distances are of the size of 1 / m.
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
      const auto record = ref::record_of(ref::project_surfel(moved, k, from, options));
      double sum = 0;
      for (std::size_t i = 0; i < 20; ++i)
        if (by[i] != 0) sum += by[i] * record[i];
      return sum;
    });
  }
  return p;
}

// The losses' derivatives by each of the Gaussians' floats, `each` of them a Gaussian; step(Gaussian, which).
inline std::vector<double> by_field(const ProjectionRows& p, const Gaussians& given, const Camera& cam,
                                    std::vector<float> Gaussians::*field, std::size_t each,
                                    const std::function<double(std::size_t, std::size_t)>& step) {
  Gaussians g = given;
  std::vector<double> out((g.*field).size(), 0.0);
  for (std::size_t i = 0; i < p.ids.size(); ++i)
    for (std::size_t j = 0; j < each; ++j) {
      const std::size_t at = p.ids[i] * each + j;
      out[at] = ref::derivative_by((g.*field)[at], step(p.ids[i], j), [&] { return p.losses[i](g, cam); });
    }
  return out;
}

// And by the camera's pose, [6].
inline std::vector<double> by_pose(const ProjectionRows& p, const Gaussians& g, const Camera& cam, double step) {
  std::vector<double> out;
  for (Eigen::Index i = 0; i < 6; ++i)
    out.push_back(ref::derivative_at_0(step, [&](double h) {
      Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
      motion[i] = h;
      Camera moved = cam;
      moved.w2c = exp_se3(motion) * cam.w2c;
      double sum = 0;
      for (const auto& one : p.losses) sum += one(g, moved);
      return sum;
    }));
  return out;
}

}  // namespace vsplat::selftest
