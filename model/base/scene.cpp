#include "model/base/scene.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/camera.h"
#include "runtime/fail.h"

namespace vsplat {

Similarity Similarity::from_matrix(const Eigen::Matrix4d& m) {
  Similarity s;
  const Eigen::Matrix3d a = m.topLeftCorner<3, 3>();
  const double det = a.determinant();
  if (!m.allFinite() || !(det > 0)) {
    fail(Status::input, "transform: the matrix's determinant is {}: it must be positive (a rotation and a scale)", det);
  }
  s.scale = std::cbrt(det);
  s.rotation = a / s.scale;
  s.translation = m.topRightCorner<3, 1>();
  const double off = (s.rotation * s.rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (off > 1e-4) fail(Status::input, "transform: the matrix is no rotation times a scale (off by {:.1e})", off);
  // Use the nearest rotation, because poses in files are rounded.
  s.rotation = Eigen::Quaterniond(s.rotation).normalized().toRotationMatrix();
  return s;
}

Similarity Similarity::inverse() const {
  Similarity s;
  s.scale = 1 / scale;
  s.rotation = rotation.transpose();
  s.translation = -s.scale * (s.rotation * translation);
  return s;
}

Similarity operator*(const Similarity& after, const Similarity& before) {
  Similarity s;
  s.scale = after.scale * before.scale;
  s.rotation = after.rotation * before.rotation;
  s.translation = after.scale * (after.rotation * before.translation) + after.translation;
  return s;
}

Eigen::VectorXd sh_basis(int degree, const Eigen::Vector3d& d) {
  const double x = d.x(), y = d.y(), z = d.z(), xx = x * x, yy = y * y, zz = z * z;
  const double all[25] = {kShC0,
                          -0.4886025119029199 * y,
                          0.4886025119029199 * z,
                          -0.4886025119029199 * x,
                          1.0925484305920792 * x * y,
                          -1.0925484305920792 * y * z,
                          0.31539156525252005 * (2 * zz - xx - yy),
                          -1.0925484305920792 * x * z,
                          0.5462742152960396 * (xx - yy),
                          -0.5900435899266435 * y * (3 * xx - yy),
                          2.890611442640554 * x * y * z,
                          -0.4570457994644658 * y * (4 * zz - xx - yy),
                          0.3731763325901154 * z * (2 * zz - 3 * xx - 3 * yy),
                          -0.4570457994644658 * x * (4 * zz - xx - yy),
                          1.445305721320277 * z * (xx - yy),
                          -0.5900435899266435 * x * (xx - 3 * yy),
                          2.5033429417967046 * x * y * (xx - yy),
                          -1.7701307697799304 * y * z * (3 * xx - yy),
                          0.9461746957575601 * x * y * (7 * zz - 1),
                          -0.6690465435572892 * y * z * (7 * zz - 3),
                          0.10578554691520431 * (zz * (35 * zz - 30) + 3),
                          -0.6690465435572892 * x * z * (7 * zz - 3),
                          0.47308734787878004 * (xx - yy) * (7 * zz - 1),
                          -1.7701307697799304 * x * z * (xx - 3 * yy),
                          0.6258357354491761 * (xx * (xx - 3 * yy) - yy * (3 * xx - yy))};
  return Eigen::Map<const Eigen::VectorXd>(all, (degree + 1) * (degree + 1));
}

Eigen::MatrixXd sh_rotation(int degree, const Eigen::Matrix3d& rotation) {
  // A band is closed under rotation, so c' is determined by f'(d) = f(R^T d) in enough directions: B c' = B_R c with
  // the basis at d and at R^T d. 40 directions on a spiral make it well conditioned.
  constexpr int kSamples = 40;
  const int first = degree * degree, size = 2 * degree + 1;
  Eigen::MatrixXd at(kSamples, size), before(kSamples, size);
  for (int i = 0; i < kSamples; ++i) {
    const double z = 1 - (2.0 * i + 1) / kSamples, r = std::sqrt(1 - z * z), a = 2.399963229728653 * i;
    const Eigen::Vector3d d(r * std::cos(a), r * std::sin(a), z);
    at.row(i) = sh_basis(degree, d).segment(first, size);
    before.row(i) = sh_basis(degree, rotation.transpose() * d).segment(first, size);
  }
  return at.colPivHouseholderQr().solve(before);
}

namespace {

void rotate_sh(Gaussians& g, const Eigen::Matrix3d& rotation) {
  for (int degree = 1; degree <= g.sh_degree; ++degree) {
    const Eigen::MatrixXd turn = sh_rotation(degree, rotation);
    const auto first = static_cast<std::size_t>(degree) * degree;
    using Band = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
    for (std::size_t k = 0; k < g.count; ++k) {
      Eigen::Map<Band> band(&g.sh[(k * g.sh_count() + first) * 3], turn.rows(), 3);
      band = (turn * band.cast<double>()).cast<float>();
    }
  }
}

}  // namespace

void transform(Gaussians& g, const Similarity& move) {
  // A Gaussian is its own image through its centre, so a rotation that mirrors turns its axes as its negative does.
  const bool mirrors = move.rotation.determinant() < 0;
  const Eigen::Quaterniond turn(mirrors ? Eigen::Matrix3d(-move.rotation) : move.rotation);
  for (float& s : g.scales) s = static_cast<float>(s * move.scale);
  for (std::size_t k = 0; k < g.count; ++k) {
    Eigen::Map<Eigen::Vector3f> mean(&g.means[3 * k]);
    mean = (move.scale * (move.rotation * mean.cast<double>()) + move.translation).cast<float>();
    float* q = &g.quats[4 * k];
    const Eigen::Quaterniond turned = (turn * Eigen::Quaterniond(q[0], q[1], q[2], q[3])).normalized();
    q[0] = static_cast<float>(turned.w());
    q[1] = static_cast<float>(turned.x());
    q[2] = static_cast<float>(turned.y());
    q[3] = static_cast<float>(turned.z());
  }
  // Without a rotation the coefficients stay identical bit for bit.
  if (!move.rotation.isIdentity(0)) rotate_sh(g, move.rotation);
}

void transform(Scene& scene, const Similarity& in_world, const Eigen::Vector3d& offset) {
  Similarity move = in_world;
  // Computed in double, because this subtracts two large and similar positions.
  if (!scene.offset.isZero(0) || !offset.isZero(0)) move.translation = in_world.apply(scene.offset) - offset;
  scene.offset = offset;
  transform(scene.gaussians, move);
  scene.near = static_cast<float>(scene.near * move.scale);
  const auto carry = [&move](std::array<float, 3>& place) {
    const Eigen::Vector3d to =
        move.scale * (move.rotation * Eigen::Vector3d(place[0], place[1], place[2])) + move.translation;
    for (int i = 0; i < 3; ++i) place[i] = static_cast<float>(to[i]);
  };
  if (scene.mirror) carry(*scene.mirror);
  if (scene.detail) {
    carry(scene.detail->at);
    scene.detail->pixel = static_cast<float>(scene.detail->pixel * move.scale);
  }
  if (scene.up) {
    auto& up = *scene.up;
    const Eigen::Vector3d turned = (move.rotation * Eigen::Vector3d(up[0], up[1], up[2])).normalized();
    for (int i = 0; i < 3; ++i) up[i] = static_cast<float>(turned[i]);
  }
}

Gaussians thickened(const Gaussians& surfels, double thickness) {
  Gaussians out = surfels;
  out.kind = GaussianKind::volume;
  out.scales.resize(3 * surfels.count);
  for (std::size_t k = 0; k < surfels.count; ++k) {
    const float u = surfels.scales[2 * k], v = surfels.scales[2 * k + 1];
    out.scales[3 * k] = u;
    out.scales[3 * k + 1] = v;
    out.scales[3 * k + 2] = static_cast<float>(thickness * std::min(u, v));
  }
  return out;
}

Eigen::Vector3d offset_for(const Eigen::Vector3d& centre, double edge) {
  constexpr double held = 1e-4, half_step = 0x1p-24;  // share of the edge; relative rounding error of a float
  const double farthest = centre.cwiseAbs().maxCoeff() + 0.5 * edge;
  return farthest * half_step > held * edge ? centre : Eigen::Vector3d::Zero();
}

Camera in_frame(const Scene& scene, const Camera& camera) {
  Camera out = camera;
  if (!scene.offset.isZero(0)) out.w2c.topRightCorner<3, 1>() += camera.w2c.topLeftCorner<3, 3>() * scene.offset;
  return out;
}

}  // namespace vsplat
