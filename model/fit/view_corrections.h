// What a view's picture differs by from what the scene should show: its camera's pose a little off, its exposure and
// colour balance. Learnt beside the scene; neither is part of the result.
#pragma once
#include <Eigen/Core>
#include <array>
#include <map>
#include <string>

#include "model/fit/fit_checkpoint.h"
#include "runtime/context.h"

namespace vsplat {

// Of one camera. Adam on rotation vector and shift, in the camera's own axes, each step from where it stands.
class PoseCorrection {
 public:
  explicit PoseCorrection(const Eigen::Matrix4d& w2c) : w2c_(w2c) {}
  const Eigen::Matrix4d& w2c() const { return w2c_; }
  // `gradient` by (omega, tau) at 0, where the pose is exp([omega, tau]) w2c; `rate` in radians and in the frame's
  // units.
  void move(const std::array<double, 6>& gradient, double rate);

  // To the bit.
  std::string text() const;
  static PoseCorrection from_text(const std::string& text);

 private:
  Eigen::Matrix4d w2c_;
  std::array<double, 6> m_{}, v_{};
  long steps_ = 0;
};

// Of one picture, on the device: the map of exposure_forward(), at first none.
struct ExposureCorrection {
  Tensor map, gradient, m, v;  // f32 [1,12]
  long steps = 0;
};
ExposureCorrection make_exposure(Context& ctx);
void move(Context& ctx, ExposureCorrection& exposure, double rate);
// As tensors of a checkpoint, under "NAME.".
void put(Context& ctx, const ExposureCorrection& exposure, const std::string& name, FitCheckpoint& out);
void get(Context& ctx, ExposureCorrection& exposure, const std::string& name, const FitCheckpoint& from);

}  // namespace vsplat
