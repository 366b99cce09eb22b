#include "model/fit/view_corrections.h"

#include <Eigen/Geometry>
#include <cmath>
#include <sstream>
#include <vector>

#include "model/ops/fit/splat_adam.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"

namespace vsplat {
namespace {

// Exponential of the se(3) element (omega, tau).
Eigen::Matrix4d exp_se3(const Eigen::Vector3d& omega, const Eigen::Vector3d& tau) {
  const double angle = omega.norm();
  Eigen::Matrix3d hat;
  hat << 0, -omega.z(), omega.y(), omega.z(), 0, -omega.x(), -omega.y(), omega.x(), 0;
  Eigen::Matrix3d along = Eigen::Matrix3d::Identity();
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  if (angle > 0) {
    const double a2 = angle * angle;
    along += (1 - std::cos(angle)) / a2 * hat + (angle - std::sin(angle)) / (a2 * angle) * hat * hat;
    out.topLeftCorner<3, 3>() = Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix();
  }
  out.topRightCorner<3, 1>() = along * tau;
  return out;
}

constexpr double kBeta1 = 0.9, kBeta2 = 0.99, kEps = 1e-15;

}  // namespace

void PoseCorrection::move(const std::array<double, 6>& gradient, double rate) {
  ++steps_;
  std::array<double, 6> by{};
  for (std::size_t i = 0; i < 6; ++i) {
    m_[i] = kBeta1 * m_[i] + (1 - kBeta1) * gradient[i];
    v_[i] = kBeta2 * v_[i] + (1 - kBeta2) * gradient[i] * gradient[i];
    const auto t = static_cast<double>(steps_);
    by[i] = -rate * m_[i] / (1 - std::pow(kBeta1, t)) / (std::sqrt(v_[i] / (1 - std::pow(kBeta2, t))) + kEps);
  }
  w2c_ = exp_se3({by[0], by[1], by[2]}, {by[3], by[4], by[5]}) * w2c_;
}

std::string PoseCorrection::text() const {
  std::string out = std::to_string(steps_);
  for (Eigen::Index r = 0; r < 3; ++r)
    for (Eigen::Index c = 0; c < 4; ++c) out += " " + exact_text(w2c_(r, c));
  for (const double value : m_) out += " " + exact_text(value);
  for (const double value : v_) out += " " + exact_text(value);
  return out;
}

PoseCorrection PoseCorrection::from_text(const std::string& text) {
  std::istringstream in(text);
  in.imbue(std::locale::classic());
  PoseCorrection out(Eigen::Matrix4d::Identity());
  in >> out.steps_;
  for (Eigen::Index r = 0; r < 3; ++r)
    for (Eigen::Index c = 0; c < 4; ++c) in >> out.w2c_(r, c);
  for (double& value : out.m_) in >> value;
  for (double& value : out.v_) in >> value;
  if (!in || out.steps_ < 0 || !out.w2c_.allFinite())
    fail(Status::format, "a fit's state has a pose that cannot be read: 25 numbers expected");
  return out;
}

ExposureCorrection make_exposure(Context& ctx) {
  const std::vector<float> none{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, zeros(12, 0.0f);
  return {ctx.upload({1, 12}, none, Type::f32, "exposure"), ctx.upload({1, 12}, zeros, Type::f32, "exposure"),
          ctx.upload({1, 12}, zeros, Type::f32, "exposure"), ctx.upload({1, 12}, zeros, Type::f32, "exposure"), 0};
}

void move(Context& ctx, ExposureCorrection& exposure, double rate) {
  SplatAdam a{exposure.map, exposure.gradient, exposure.m, exposure.v, ++exposure.steps};
  a.rate = rate;
  splat_adam(ctx, a);
}

namespace {

std::vector<std::pair<std::string, Tensor>> parts(const ExposureCorrection& exposure, const std::string& name) {
  return {{name + ".map", exposure.map}, {name + ".m", exposure.m}, {name + ".v", exposure.v}};
}

}  // namespace

void put(Context& ctx, const ExposureCorrection& exposure, const std::string& name, FitCheckpoint& out) {
  for (const auto& [part, tensor] : parts(exposure, name))
    out.tensors[part] = {tensor.shape(), ctx.read<float>(tensor)};
  out.state[name + ".steps"] = std::to_string(exposure.steps);
}

void get(Context& ctx, ExposureCorrection& exposure, const std::string& name, const FitCheckpoint& from) {
  for (const auto& [part, tensor] : parts(exposure, name)) {
    const FitTensor& kept = tensor_of(from.tensors, part);
    if (kept.shape != tensor.shape())
      fail(Status::format, "a fit's state has {} for {}, {} expected", text_of(kept.shape), part,
           text_of(tensor.shape()));
    ctx.write(tensor, kept.data.data());
  }
  exposure.steps = whole_number(from, name + ".steps");
}

}  // namespace vsplat
