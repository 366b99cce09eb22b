// Per-view corrections for a picture that differs from the scene: a pose error of its camera, and its exposure and
// colour balance. They are learnt with the scene and are not part of the result.
#pragma once
#include <Eigen/Core>
#include <array>
#include <map>
#include <string>

#include "model/fit/fit_checkpoint.h"
#include "runtime/context.h"

namespace vsplat {

// Corrects one camera's pose. Adam on rotation vector and translation in the camera's own axes, each step relative to
// the current pose.
class PoseCorrection {
 public:
  explicit PoseCorrection(const Eigen::Matrix4d& w2c) : w2c_(w2c) {}
  const Eigen::Matrix4d& w2c() const { return w2c_; }
  // `gradient`: by (omega, tau) at 0, for the pose exp([omega, tau]) w2c. `rate`: in radians, and in the frame's units.
  void move(const std::array<double, 6>& gradient, double rate);

  // Text that restores the same bits.
  std::string text() const;
  static PoseCorrection from_text(const std::string& text);

 private:
  Eigen::Matrix4d w2c_;
  std::array<double, 6> m_{}, v_{};
  long steps_ = 0;
};

// Corrects one picture's exposure, on the device: the map of exposure_forward(), at first the identity.
struct ExposureCorrection {
  Tensor map, gradient, m, v;  // f32 [1,12]
  long steps = 0;
};
ExposureCorrection make_exposure(Context& ctx);
void move(Context& ctx, ExposureCorrection& exposure, double rate);
// put() stores it as tensors of a checkpoint, under "NAME."; get() loads it.
void put(Context& ctx, const ExposureCorrection& exposure, const std::string& name, FitCheckpoint& out);
void get(Context& ctx, ExposureCorrection& exposure, const std::string& name, const FitCheckpoint& from);

}  // namespace vsplat
