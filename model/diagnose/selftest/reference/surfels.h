// 2D Gaussian splatting of one picture, in double and straightforward: the reference for cl/render/project_surfels.cl
// and cl/render/rasterize_surfels.cl.
#pragma once
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "model/diagnose/selftest/reference/splat.h"

namespace vsplat::ref {

struct Surfel {
  bool culled = true;
  Eigen::Matrix3d T = Eigen::Matrix3d::Zero();  // (x z, y z, z) = T (s, t, 1) of the pixel (x, y) where (s, t) is seen
  Eigen::Vector3d normal = Eigen::Vector3d::Zero(), colour = Eigen::Vector3d::Zero();
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // of the box that the low pass is about
  double z = 0, opacity = 0;
  double facing = 0;                   // the cosine between the normal and the line of sight
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;  // tiles
};

struct SurfelOptions {
  Options options;
  bool current = false;  // the later state of the original rasteriser
};

inline Surfel project_surfel(const Gaussians& g, std::size_t k, const Camera& cam, const SurfelOptions& o) {
  Surfel s;
  const Eigen::Matrix3d W = cam.w2c.topLeftCorner<3, 3>();
  const Eigen::Vector3d mean(g.means[3 * k], g.means[3 * k + 1], g.means[3 * k + 2]);
  const Eigen::Vector3d p = W * mean + cam.w2c.topRightCorner<3, 1>();
  s.z = p.z();
  if (!(s.z > o.options.near)) return s;
  const Eigen::Quaterniond q(g.quats[4 * k], g.quats[4 * k + 1], g.quats[4 * k + 2], g.quats[4 * k + 3]);
  const Eigen::Matrix3d R = W * q.normalized().toRotationMatrix();
  Eigen::Matrix3d M, K;
  M << R.col(0) * g.scales[2 * k], R.col(1) * g.scales[2 * k + 1], p;
  K << cam.fx, 0, cam.cx, 0, cam.fy, cam.cy, 0, 0, 1;
  s.T = K * M;
  const double facing = -R.col(2).dot(p);
  s.facing = facing / p.norm();
  s.normal = facing > 0 ? R.col(2) : Eigen::Vector3d(-R.col(2));
  const double cut = o.current ? 3 : 1;
  const Eigen::Vector3d sign(cut * cut, cut * cut, -1);
  const double d = sign.dot(s.T.row(2).cwiseAbs2().transpose());
  const Eigen::Vector3d f = sign / d;
  double half = 0;
  for (int i = 0; i < 2; ++i) {
    s.centre[i] = f.dot(s.T.row(i).cwiseProduct(s.T.row(2)).transpose());
    const double half2 = s.centre[i] * s.centre[i] - f.dot(s.T.row(i).cwiseAbs2().transpose());
    half = std::max(half, std::sqrt(std::max(half2, o.current ? 1e-4 : 0.0)));
  }
  const double radius =
      o.current ? std::ceil(std::max(half, 3 * 0.707106)) : std::ceil(3 * std::max(half, 0.7071067811865476));
  const int tiles_x = (cam.width + 15) / 16, tiles_y = (cam.height + 15) / 16;
  const auto tile = [](double at, int most) {
    return static_cast<int>(std::clamp(std::trunc(at / 16), 0.0, 1.0 * most));
  };
  const Eigen::Vector2d at = s.centre.array() - (o.current ? 0.5 : 0.0);
  s.x0 = tile(at.x() - radius, tiles_x);
  s.x1 = tile(at.x() + radius + 15, tiles_x);
  s.y0 = tile(at.y() - radius, tiles_y);
  s.y1 = tile(at.y() + radius + 15, tiles_y);
  s.opacity = g.opacities[k];
  const Eigen::Vector3d centre =
      o.options.mirror ? Eigen::Vector3d(2 * *o.options.mirror - cam.centre()) : cam.centre();
  const std::vector<double> b = basis((mean - centre).normalized(), g.sh_count());
  s.colour.setConstant(0.5);
  for (std::size_t i = 0; i < b.size(); ++i)
    for (int ch = 0; ch < 3; ++ch) s.colour[ch] += b[i] * g.sh[(k * b.size() + i) * 3 + static_cast<std::size_t>(ch)];
  s.colour = s.colour.cwiseMax(0.0);
  s.culled = s.x0 >= s.x1 || s.y0 >= s.y1 || facing == 0 || d == 0;
  return s;
}

// What a pixel sees of a surfel.
struct Meeting {
  double alpha = 0;  // 0 where it is not seen
  double depth = 0;
};

inline Meeting meet(const Surfel& s, double x, double y, const SurfelOptions& o) {
  const Eigen::Vector3d k = x * s.T.row(2) - s.T.row(0), l = y * s.T.row(2) - s.T.row(1), h = k.cross(l);
  if (h.z() == 0) return {};
  const double u = h.x() / h.z(), v = h.y() / h.z();
  const double rho3 = u * u + v * v, rho2 = 2 * (s.centre - Eigen::Vector2d(x, y)).squaredNorm();
  const bool intersection = rho3 <= rho2 || o.current;
  const double depth = intersection ? s.T.row(2).dot(Eigen::Vector3d(u, v, 1)) : s.z;
  const double alpha = std::min<double>(0.99f, s.opacity * std::exp(-0.5 * std::min(rho3, rho2)));
  if (depth < o.options.near || alpha < static_cast<double>(1.0f / 255.0f)) return {};
  return {alpha, depth};
}

struct SurfelFrame : Frame {
  std::vector<double> normal, median, distortion;  // [H,W,3], [H,W], [H,W]
};

// What blending sums up of those that a pixel sees, near to far.
struct SurfelPixel {
  double alpha = 0, depth = 0, median = 0, distortion = 0, T = 1;
  Eigen::Vector3d colour = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
  std::vector<std::pair<double, double>> seen;  // weights and warped depths

  // False where the pixel ends before it.
  bool add(const Meeting& at, const Eigen::Vector3d& tint, const Eigen::Vector3d& facing, double near) {
    if (T * (1 - at.alpha) < static_cast<double>(1e-4f)) return false;
    const double w = T * at.alpha, m = 500.0 / 499.0 * (1 - near / at.depth);
    colour += w * tint;
    normal += w * facing;
    alpha += w;
    depth += w * at.depth;
    if (T > 0.5) median = at.depth;
    for (const auto& [weight, other] : seen) distortion += w * weight * (m - other) * (m - other);
    seen.emplace_back(w, m);
    T *= 1 - at.alpha;
    return true;
  }

  void write(const std::array<double, 3>& background, SurfelFrame& out) const {
    for (int c = 0; c < 3; ++c) {
      out.colour.push_back(colour[c] + (1 - alpha) * background[static_cast<std::size_t>(c)]);
      out.normal.push_back(normal[c]);
    }
    out.alpha.push_back(alpha);
    out.depth.push_back(depth);
    out.median.push_back(median);
    out.distortion.push_back(distortion);
  }
};

inline SurfelFrame render_surfels(const Gaussians& g, const Camera& cam, const SurfelOptions& o) {
  std::vector<Surfel> all;
  for (std::size_t k = 0; k < g.count; ++k) {
    const Surfel s = project_surfel(g, k, cam, o);
    if (!s.culled) all.push_back(s);
  }
  std::stable_sort(all.begin(), all.end(), [](const Surfel& l, const Surfel& r) { return l.z < r.z; });
  SurfelFrame out;
  for (int y = 0; y < cam.height; ++y) {
    for (int x = 0; x < cam.width; ++x) {
      SurfelPixel pixel;
      for (const Surfel& s : all) {
        if (x / 16 < s.x0 || x / 16 >= s.x1 || y / 16 < s.y0 || y / 16 >= s.y1) continue;
        const Meeting at = meet(s, x + 0.5, y + 0.5, o);
        if (at.alpha > 0 && !pixel.add(at, s.colour, s.normal, o.options.near)) break;
      }
      pixel.write(o.options.background, out);
    }
  }
  return out;
}

// A record as cl/render/project_surfels.cl has it, without its reaches.
inline std::array<double, 20> record_of(const Surfel& s) {
  const double z = s.T(2, 2), u = s.T(0, 2) / z, v = s.T(1, 2) / z, w1 = s.T(2, 0), w2 = s.T(2, 1);
  const Eigen::Vector3d a1 = s.T.row(0) - u * s.T.row(2), a2 = s.T.row(1) - v * s.T.row(2);
  const double det = a1[0] * a2[1] - a1[1] * a2[0];
  return {u,
          v,
          std::log2(s.opacity),
          z,
          -z * a2[1] / det,
          z * a1[1] / det,
          z * a2[0] / det,
          -z * a1[0] / det,
          (w1 * a2[1] - w2 * a2[0]) / det,
          (w2 * a1[0] - w1 * a1[1]) / det,
          s.centre.x() - u,
          s.centre.y() - v,
          s.colour[0],
          s.colour[1],
          s.colour[2],
          0,
          s.normal[0],
          s.normal[1],
          s.normal[2],
          0};
}

}  // namespace vsplat::ref
