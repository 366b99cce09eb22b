// A scene that is moved towards pictures by gradient descent, all of it on the device.
#pragma once
#include <array>
#include <cstdint>
#include <optional>

#include "model/base/gaussians.h"
#include "model/fit/fit_checkpoint.h"
#include "model/fit/fit_picture.h"
#include "model/ops/fit/loss.h"
#include "model/ops/fit/splat_relocate.h"
#include "model/render/render.h"
#include "model/render/render_backward.h"

namespace vsplat {

// Of Adam, a step. Lengths are in units of the object's cube's edge.
struct FitRates {
  double means = 1e-3, log_scales = 1e-2, quats = 2e-3, logits = 3e-2;
  double sh = 5e-3;         // of the constant coefficients
  double sh_rest = 2.5e-4;  // of the others
};

struct FitOptions {
  FitRates rates;
  long steps = 800;               // over which the rate of the means falls
  double means_fall = 0.1;        // to this part
  long colours_first = 0;         // steps in which only colours and opacities move
  float ssim_weight = 0;          // of 1 - SSIM in the loss, beside the mean absolute error
  float alpha_weight = 0.1f;      // of the mean absolute error of alpha, where the picture says what is the object
  bool random_background = true;  // every other step, of pictures that say so
  float drop = 0;                 // share of Gaussians left out of a step
  float opacity_weight = 0, scale_weight = 0;  // of the means over Gaussians
  float pull = 0;                              // towards the start, on means and log scales
  long grow_every = 0;                         // steps between relocations; 0: none
  long grow_until = 0;                         // no relocation from this step on
  double growth = 1.1;
  long max_gaussians = 0;  // at least those that there are
  float noise = 0;         // times the rate of the means, per unit of variance
  float low_scale = 1e-5f, high_scale = 0.5f;
  std::uint64_t seed = 0;
};

// How well what is drawn agrees with a picture, over white.
struct FitScore {
  double psnr = 0, ssim = 0;
};

// What a step learns beside the scene, where it is not null.
struct FitAside {
  Tensor exposure, dexposure;              // f32 [12]: as exposure_forward() has it, and the loss by it, written
  std::array<double, 6>* dpose = nullptr;  // as render_backward() has it
};

class Fitter {
 public:
  // `near` and `mirror` as RenderOptions have them. Uploads.
  Fitter(Context& ctx, const Gaussians& start, float near, const std::optional<std::array<float, 3>>& mirror,
         const FitOptions& options);

  long count() const { return count_; }
  long steps_done() const { return step_; }

  // One step on one picture: differentiate(), then move().
  void step(const DeviceFitPicture& picture, const FitAside& aside = {});
  // Leaves the gradient of this step's loss in gradient(), or zeros where it fails. Waits for the device as
  // render_with_backward() does.
  void differentiate(const DeviceFitPicture& picture, const FitAside& aside = {});
  // Moves the parameters by the gradient, which is zeros then, and now and then relocates Gaussians.
  void move();
  // The loss of the last step on the device, f32 [3]: as PictureLoss::out.
  const Tensor& last_loss() const { return loss_; }

  SplatParameters parameters() const;
  GaussianGradients gradient() const;  // by the parameters: its scales are by log scales, its opacities by logits

  // As if it had grown as far as it may: for plans.
  void plan_grown() { count_ = all_.x.count(); }

  FitScore judge(const DeviceFitPicture& picture);
  // All that the next steps depend on, and back: the same options and start are expected.
  FitTensors state() const;
  void restore(const FitTensors& state, long steps_done);
  // As it is now; those that cannot be seen, or hold a value that is no number, are left out.
  Gaussians gaussians();

 private:
  void add_gradient(const DeviceFitPicture& picture, const FitAside& aside);
  // Where Gaussians touch far more of the picture's tiles than usual, those largest on its screen become smaller: no
  // step takes far longer than the others.
  void bound_on_screen(const Camera& camera);
  DeviceGaussians activate(Context& c, const Dropping& dropping) const;
  RenderOptions drawing() const;
  void grow();

  Context& ctx_;
  FitOptions options_;
  float near_;
  std::optional<std::array<float, 3>> mirror_;
  long count_ = 0, step_ = 0;
  SplatState all_;             // of the capacity
  GaussianGradients dall_;     // of the capacity; zeros between steps
  Tensor scales_, opacities_;  // of the capacity
  Tensor home_means_, home_scales_;
  Tensor loss_;
};

}  // namespace vsplat
