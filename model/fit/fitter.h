// Fits a scene to pictures by gradient descent, entirely on the device.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "model/base/gaussians.h"
#include "model/fit/background.h"
#include "model/fit/density/density.h"
#include "model/fit/fit_checkpoint.h"
#include "model/fit/fit_picture.h"
#include "model/ops/fit/depth_loss.h"
#include "model/ops/fit/loss.h"
#include "model/render/render.h"
#include "model/render/render_backward.h"

namespace vsplat {

// Adam learning rates. Lengths are in units of the cube's edge.
struct FitRates {
  double means = 1e-3, log_scales = 1e-2, quats = 2e-3, logits = 3e-2;
  double sh = 5e-3;         // constant coefficients
  double sh_rest = 2.5e-4;  // the other coefficients
};

struct FitOptions {
  FitRates rates;
  long steps = 800;           // over which learning rates decay
  double means_fall = 0.1;    // final decay factor of that rate
  double sh_fall = 1;         // likewise, of the spherical harmonics' rates
  long colours_first = 0;     // initial steps that change only colours and opacities
  float ssim_weight = 0;      // weight of 1 - SSIM in the loss, added to the mean absolute error
  float alpha_weight = 0.1f;  // weight of alpha's mean absolute error; masked pictures only
  float depth_weight = 0;     // weight of DepthLoss; pictures with a given depth only, and not with scores
  DepthKind depth_kind = DepthKind::metric;
  FitBackground background;
  SkySphere sky;                               // where a sky's Gaussians are
  float drop = 0;                              // share of Gaussians dropped in a step
  float opacity_weight = 0, scale_weight = 0;  // regularisers on the means over Gaussians
  float pull = 0;                              // weight of a regulariser that keeps means and log scales near the start
  DensityStrategy density = DensityStrategy::mcmc;
  long grow_every = 0;  // steps between rounds of growth, which also replace nearly transparent Gaussians; 0: none
  long grow_until = 0;  // no round from this step on
  double growth = 1.1;
  long max_gaussians = 0;  // at least the number of Gaussians of the start
  float noise = 0;         // factor on the means' learning rate, per unit of variance
  float low_scale = 1e-5f, high_scale = 0.5f;
  bool antialias = false;  // as in RenderOptions, with the 3D filter of set_cameras()
  std::uint64_t seed = 0;
  std::uint64_t most_pairs = 0;  // as in RenderOptions
};

// How well a rendering matches a picture in its known pixels, both over measured_over().
struct FitScore {
  double psnr = 0, ssim = 0;
};

// Corrections of the view that a step also differentiates by; null members are skipped.
struct FitAside {
  Tensor exposure, dexposure;  // f32 [12]: the map of exposure_forward(), and its gradient, which is overwritten
  std::array<double, 6>* dpose = nullptr;  // se(3) gradient of the camera's pose, as in render_backward()
};

class Fitter {
 public:
  // `near` and `mirror` as in RenderOptions. Uploads the start.
  Fitter(Context& ctx, const Gaussians& start, float near, const std::optional<std::array<float, 3>>& mirror,
         const FitOptions& options);

  // The cameras of the pictures that are fitted, with FitOptions::antialias: no Gaussian is drawn finer than these can
  // show (splat_filter.h). To be called before the first step; the start's Gaussians stay as they were where they are
  // not finer.
  void set_cameras(const std::vector<Camera>& cameras);

  long count() const { return count_; }
  long steps_done() const { return step_; }
  long replaced_after() const { return replaced_after_; }  // steps; 0: replace() was never called

  // One step on one picture: differentiate(), then move().
  void step(const DeviceFitPicture& picture, const FitAside& aside = {});
  // Writes the gradient of this step's loss to gradient(), or zeros if it fails. Waits for the device like
  // render_with_backward().
  void differentiate(const DeviceFitPicture& picture, const FitAside& aside = {});
  // Applies the gradient, sets it to zero, and periodically replaces and adds Gaussians.
  void move();
  // The last step's loss on the device, f32 [3], as PictureLoss::out.
  const Tensor& last_loss() const { return loss_; }

  SplatParameters parameters() const;
  GaussianGradients gradient() const;  // by the parameters: `scales` is by log scales, `opacities` by logits

  // Pretends that the scene has grown to its maximum: for plans.
  void plan_grown() { count_ = all_.x.count(); }

  // Compares a rendering with a picture, on the device: f32 [3], as PictureLoss::out.
  Tensor measure(const DeviceFitPicture& picture);
  FitScore score(const DeviceFitPicture& picture);
  // The same for a scene that gaussians() returned: a sky is then measured as the Gaussians that it became.
  FitScore score(const Gaussians& scene, const DeviceFitPicture& picture);
  // Adds to `sums`, f32 [count], each Gaussian's blending weights over the picture's pixels.
  void add_weights(const Camera& camera, const Tensor& sums);
  // Continues with these Gaussians, at most as many as there are now, with moments of zero and without growth.
  void replace(const Gaussians& gaussians);

  // The state that further steps depend on. restore() expects the options and the start that the state was made with,
  // and after how many steps replace() was called last, 0 for never.
  FitTensors state() const;
  void restore(const FitTensors& state, long steps_done, long replaced_after = 0);
  // The current scene, filtered, without Gaussians that are invisible or hold a value that is not finite.
  Gaussians foreground();
  // The same, followed by the kSkyGaussians of the sky if there is one.
  Gaussians gaussians();

 private:
  void add_gradient(const DeviceFitPicture& picture, const FitAside& aside);
  // RenderOptions::counted, once: if Gaussians touch far more of the picture's tiles than usual, shrinks the largest on
  // its screen, so that no step takes far longer than the others, and activates them again.
  std::function<bool(std::uint64_t)> bound_on_screen(const Camera& camera, const Dropping& dropping);
  DeviceGaussians activate(Context& c, const Dropping& dropping) const;
  void find_variances();
  bool scores_count() const;
  RenderOptions drawing(const std::array<float, 3>& background) const;
  void grow();

  Context& ctx_;
  FitOptions options_;
  float near_;
  std::optional<std::array<float, 3>> mirror_;
  long count_ = 0, step_ = 0;
  long replaced_after_ = 0;    // steps done when replace() was called; 0: never
  SplatState all_;             // rows for the maximum number of Gaussians, as in the next three
  GaussianGradients dall_;     // zeros between steps
  Tensor scales_, opacities_;  // activated
  Tensor home_means_, home_scales_;
  Tensor views_, variances_;  // the filter's cameras and variances; none: no filter
  Tensor loss_;
  std::unique_ptr<Density> density_;
  Tensor fresh_scores_;  // [capacity], of the gradient's picture; none if the strategy uses no scores
  std::optional<Sky> sky_;
  RepeatedWork gradients_;
};

}  // namespace vsplat
