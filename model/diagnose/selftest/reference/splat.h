// 3D Gaussian splatting of one picture, in double and straightforward: the reference for cl/render/project.cl,
// cl/render/tile_bin.cl and cl/render/rasterize.cl.
#pragma once
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <optional>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"

namespace vsplat::ref {

struct Splat {
  bool culled = true;
  double u = 0, v = 0, z = 0, a = 0, b = 0, c = 0, opacity = 0;  // covariance [a b; b c] in pixels^2
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;                            // tiles
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();
  // How many times wider the two largest scales' parallelogram is than the Gaussian's outline, with `antialias`: by so
  // much a rounding error of a rotation grows in the opacity. 1 for a disc seen face on.
  double edge_on = 0;
};

struct Options {
  double near = 0.2f;
  std::array<double, 3> background{1, 1, 1};
  std::optional<Eigen::Vector3d> mirror = {};
  bool antialias = false;  // opacities times sqrt(det / det'), of the covariance before and after 0.3 is added
};

inline std::vector<double> basis(const Eigen::Vector3d& d, std::size_t count) {
  const double x = d.x(), y = d.y(), z = d.z();
  std::vector<double> b{0.28209479177387814,
                        -0.4886025119029199 * y,
                        0.4886025119029199 * z,
                        -0.4886025119029199 * x,
                        1.0925484305920792 * x * y,
                        -1.0925484305920792 * y * z,
                        0.31539156525252005 * (2 * z * z - x * x - y * y),
                        -1.0925484305920792 * x * z,
                        0.5462742152960396 * (x * x - y * y),
                        -0.5900435899266435 * y * (3 * x * x - y * y),
                        2.890611442640554 * x * y * z,
                        -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
                        0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
                        -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
                        1.445305721320277 * z * (x * x - y * y),
                        -0.5900435899266435 * x * (x * x - 3 * y * y)};
  b.resize(count);
  return b;
}

inline Splat project(const Gaussians& g, std::size_t k, const Camera& cam, const Options& options) {
  Splat s;
  const Eigen::Matrix3d W = cam.w2c.topLeftCorner<3, 3>();
  const Eigen::Vector3d mean(g.means[3 * k], g.means[3 * k + 1], g.means[3 * k + 2]);
  const Eigen::Vector3d p = W * mean + cam.w2c.topRightCorner<3, 1>();
  s.z = p.z();
  if (!(s.z > options.near)) return s;
  s.u = cam.fx * p.x() / s.z + cam.cx;
  s.v = cam.fy * p.y() / s.z + cam.cy;
  const double lx = 1.3 * cam.width / (2 * cam.fx), ly = 1.3 * cam.height / (2 * cam.fy);
  const double tx = std::clamp(p.x() / s.z, -lx, lx), ty = std::clamp(p.y() / s.z, -ly, ly);
  Eigen::Matrix<double, 2, 3> J;
  J << cam.fx / s.z, 0, -cam.fx * tx / s.z, 0, cam.fy / s.z, -cam.fy * ty / s.z;
  const Eigen::Quaterniond q(g.quats[4 * k], g.quats[4 * k + 1], g.quats[4 * k + 2], g.quats[4 * k + 3]);
  const Eigen::Vector3d scale(g.scales[3 * k], g.scales[3 * k + 1], g.scales[3 * k + 2]);
  const Eigen::Matrix<double, 2, 3> S = J * W * q.normalized().toRotationMatrix() * scale.asDiagonal();
  const Eigen::Matrix2d cov = S * S.transpose();
  s.a = cov(0, 0) + 0.3;
  s.b = cov(0, 1);
  s.c = cov(1, 1) + 0.3;
  const double mid = 0.5 * (s.a + s.c), det = s.a * s.c - s.b * s.b;
  const double radius = std::ceil(3 * std::sqrt(mid + std::sqrt(std::max(0.1, mid * mid - det))));
  const int tiles_x = (cam.width + 15) / 16, tiles_y = (cam.height + 15) / 16;
  const auto tile = [](double at, int most) {
    return static_cast<int>(std::clamp(std::trunc(at / 16), 0.0, 1.0 * most));
  };
  s.x0 = tile(s.u - 0.5 - radius, tiles_x);
  s.x1 = tile(s.u - 0.5 + radius + 15, tiles_x);
  s.y0 = tile(s.v - 0.5 - radius, tiles_y);
  s.y1 = tile(s.v - 0.5 + radius + 15, tiles_y);
  s.opacity = g.opacities[k];
  if (options.antialias) {  // by the cross product: with thin ones, det cancels even in double
    const Eigen::Vector3d across = S.row(0).transpose().cross(S.row(1).transpose());
    s.opacity *= std::sqrt(across.squaredNorm() / det);
    const Eigen::Vector3d pairs(scale.y() * scale.z(), scale.x() * scale.z(), scale.x() * scale.y());
    const Eigen::Vector3d jn = J.row(0).transpose().cross(J.row(1).transpose());
    s.edge_on = jn.norm() * pairs.maxCoeff() / across.norm();
  }
  const Eigen::Vector3d centre = options.mirror ? Eigen::Vector3d(2 * *options.mirror - cam.centre()) : cam.centre();
  const Eigen::Vector3d d = mean - centre;
  const std::size_t n = g.sh_count();
  const std::vector<double> b = basis(d.norm() > 0 ? Eigen::Vector3d(d / d.norm()) : d, n);
  s.colour.setConstant(0.5);
  for (std::size_t i = 0; i < n; ++i)
    for (int ch = 0; ch < 3; ++ch) s.colour[ch] += b[i] * g.sh[(k * n + i) * 3 + static_cast<std::size_t>(ch)];
  s.colour = s.colour.cwiseMax(0.0);
  s.culled = s.x0 >= s.x1 || s.y0 >= s.y1;
  return s;
}

struct Frame {
  std::vector<double> colour, alpha, depth;  // [H,W,3], [H,W], [H,W]
};

inline std::vector<Splat> project_all(const Gaussians& g, const Camera& cam, const Options& options) {
  std::vector<Splat> out;
  for (std::size_t k = 0; k < g.count; ++k) out.push_back(project(g, k, cam, options));
  return out;
}

// The drawn ones, near to far.
inline std::vector<const Splat*> depth_order(const std::vector<Splat>& all) {
  std::vector<const Splat*> order;
  for (const Splat& s : all)
    if (!s.culled) order.push_back(&s);
  std::stable_sort(order.begin(), order.end(), [](const Splat* l, const Splat* r) { return l->z < r->z; });
  return order;
}

// Adds one pixel to the frame.
inline void blend_pixel(const std::vector<const Splat*>& order, int x, int y, const Options& options, Frame& out) {
  double T = 1, alpha = 0, depth = 0;
  Eigen::Vector3d colour = Eigen::Vector3d::Zero();
  for (const Splat* s : order) {
    if (x / 16 < s->x0 || x / 16 >= s->x1 || y / 16 < s->y0 || y / 16 >= s->y1) continue;
    const double dx = s->u - (x + 0.5), dy = s->v - (y + 0.5), det = s->a * s->c - s->b * s->b;
    const double power = -0.5 * (s->c * dx * dx + s->a * dy * dy) / det + s->b * dx * dy / det;
    const double a = std::min<double>(0.99f, s->opacity * std::exp(power));
    if (power > 0 || a < static_cast<double>(1.0f / 255.0f)) continue;
    if (T * (1 - a) < static_cast<double>(1e-4f)) break;
    colour += T * a * s->colour;
    alpha += T * a;
    depth += T * a * s->z;
    T *= 1 - a;
  }
  for (int c = 0; c < 3; ++c)
    out.colour.push_back(colour[c] + (1 - alpha) * options.background[static_cast<std::size_t>(c)]);
  out.alpha.push_back(alpha);
  out.depth.push_back(depth);
}

inline Frame render(const Gaussians& g, const Camera& cam, const Options& options = {}) {
  const std::vector<Splat> all = project_all(g, cam, options);
  const std::vector<const Splat*> order = depth_order(all);
  Frame out;
  for (int y = 0; y < cam.height; ++y)
    for (int x = 0; x < cam.width; ++x) blend_pixel(order, x, y, options, out);
  return out;
}

}  // namespace vsplat::ref
