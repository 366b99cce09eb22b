// The loss of a fit's step, computed in double from its definition, for differences against the fitter's gradients.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/base/rng.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/diagnose/selftest/reference/sky_background.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/diagnose/selftest/reference/splat_parameters.h"
#include "model/fit/fitter.h"

namespace vsplat::test {

inline constexpr float kNear = 0.05f;

inline std::uint8_t byte_of(double v) { return static_cast<std::uint8_t>(std::lround(std::clamp(v, 0.0, 1.0) * 255)); }

// Parameters on the host, in Fitter's form.
struct Parameters {
  std::vector<float> means, log_scales, quats, logits, sh;
};

// The loss of a step in double, from the definitions of its terms.
struct Objective {
  const FitPicture& picture;
  FitOptions options;
  ref::Options drawing;
  bool similar = true;
  ref::Left left;
  Parameters home;
  std::vector<float> variances = {};  // of the 3D filter; empty: none
  std::vector<double> sky = {};       // coefficients [25,3], or none
  std::vector<float> target = {};     // fixed at the parameters at which the gradient is taken

  std::vector<double> opacities(const Parameters& x) const {
    std::vector<double> out;
    for (std::size_t k = 0; k < x.logits.size(); ++k) out.push_back(ref::splat_opacity(x.logits[k], left, k));
    for (std::size_t i = 0; i < x.log_scales.size() && !variances.empty(); ++i) {
      const double s = ref::splat_scale(x.log_scales[i]);
      out[i / 3] *= s / std::hypot(s, std::sqrt(variances[i / 3]));
    }
    return out;
  }

  Gaussians gaussians(const Parameters& x) const {
    Gaussians g;
    g.count = x.logits.size();
    while (3 * g.count * g.sh_count() < x.sh.size()) ++g.sh_degree;
    g.means = x.means, g.quats = x.quats, g.sh = x.sh;
    for (const float v : x.log_scales) g.scales.push_back(static_cast<float>(ref::splat_scale(v)));
    for (const double v : opacities(x)) g.opacities.push_back(static_cast<float>(v));
    for (std::size_t i = 0; i < g.scales.size() && !variances.empty(); ++i) {
      const double s = static_cast<double>(g.scales[i]), filtered = std::hypot(s, std::sqrt(variances[i / 3]));
      g.scales[i] = static_cast<float>(filtered);
    }
    return g;
  }

  ref::Frame render(const Parameters& x) const {
    const Gaussians g = gaussians(x);
    const std::vector<double> exact = opacities(x);
    std::vector<ref::Splat> splats = ref::project_all(g, picture.camera, drawing);
    // Opacities rounded to floats would be noise in differences, as large as the tolerance.
    for (std::size_t k = 0; k < g.count; ++k)
      if (exact[k] > 0) splats[k].opacity *= exact[k] / g.opacities[k];
    ref::Frame out;
    const std::vector<const ref::Splat*> order = ref::depth_order(splats);
    for (int y = 0; y < picture.camera.height; ++y)
      for (int i = 0; i < picture.camera.width; ++i) ref::blend_pixel(order, i, y, drawing, out);
    if (!sky.empty()) out.colour = ref::over_sky(sky, picture.camera, out.colour, out.alpha);
    return out;
  }

  bool known(std::size_t pixel) const { return picture.known.empty() || picture.known[pixel] != 0; }

  // Returns the distance of the drawn picture from the loss's kinks: from the target, and from black and white.
  double hold(const Parameters& x) {
    const ref::Frame f = render(x);
    double nearest = 1;
    target.clear();
    for (std::size_t i = 0; i < f.colour.size(); ++i) {
      const std::uint8_t* given = &picture.rgba[i / 3 * 4];
      const double want = (given[i % 3] + (255 - given[3]) * drawing.background[i % 3]) / 255;
      target.push_back(static_cast<float>(known(i / 3) ? want : f.colour[i]));
      nearest = std::min({nearest, f.colour[i], 1 - f.colour[i]});
      if (known(i / 3)) nearest = std::min(nearest, std::abs(f.colour[i] - want));
      if (known(i / 3) && picture.masked)
        nearest = std::min(nearest, std::abs(f.alpha[i / 3] - given[3] / 255.0) - 0.5 / 255);
    }
    return nearest;
  }

  double operator()(const Parameters& x) const {
    const ref::Frame f = render(x);
    double sum = ref::loss(f.colour, target, picture.camera.height, picture.camera.width,
                           static_cast<double>(options.ssim_weight), {true, true, similar})[0];
    for (std::size_t i = 0; i < f.colour.size(); ++i)  // 0 where nothing is known, instead of a kink with a rounded
                                                       // position
      if (!known(i / 3))
        sum -= std::abs(f.colour[i] - static_cast<double>(target[i])) / static_cast<double>(f.colour.size());
    const auto pixels = static_cast<double>(f.alpha.size()), count = static_cast<double>(x.logits.size());
    for (std::size_t i = 0; i < f.alpha.size() && picture.masked; ++i)
      if (known(i)) sum += options.alpha_weight / pixels * std::abs(f.alpha[i] - picture.rgba[4 * i + 3] / 255.0);
    for (const float v : x.logits) sum += options.opacity_weight / count / (1 + std::exp(-static_cast<double>(v)));
    for (std::size_t i = 0; i < x.means.size(); ++i) {
      sum += options.scale_weight / count * std::exp(static_cast<double>(x.log_scales[i]));
      const double a = static_cast<double>(x.means[i]) - home.means[i];
      const double b = static_cast<double>(x.log_scales[i]) - home.log_scales[i];
      sum += options.pull / count / 2 * (a * a + b * b);
    }
    return sum;
  }
};

}  // namespace vsplat::test
