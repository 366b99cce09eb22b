// Pictures of a known scene, and a start for fits of it.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/fit/scene_fit.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat::test {

inline constexpr int kSceneFitSize = 48;

// A scene, pictures of it with alpha from all around, and a start that is slightly wrong.
class SceneFitTest : public ::testing::Test {
 protected:
  static Context& ctx() { return context(Flavour::cpu); }

  void make(int views) {
    truth_ = Scene();
    truth_.near = 0.05f;
    Gaussians& g = truth_.gaussians;
    g.count = 60;
    const auto random = random_floats(g.count * 8, 5, 0, 1);
    for (std::size_t k = 0; k < g.count; ++k) {
      const float* r = &random[8 * k];
      for (int i = 0; i < 3; ++i) g.means.push_back(0.6f * r[i] - 0.3f);
      for (int i = 0; i < 3; ++i) g.scales.push_back(0.03f + 0.04f * r[3 + i]);
      for (const float q : {1.0f, r[6], r[7], 0.0f}) g.quats.push_back(q);
      g.opacities.push_back(0.9f);
      for (int i = 0; i < 3; ++i) g.sh.push_back(3 * r[(k + static_cast<std::size_t>(i)) % 8] - 1.5f);
    }
    photographs_.set.source = "pictures in memory";
    for (int v = 0; v < views; ++v) {
      ListedView listed;
      listed.camera = orbit(views, kSceneFitSize).at(static_cast<std::size_t>(v));
      listed.name = listed.camera.file = "picture " + std::to_string(v);
      listed.picture = listed.name;
      photographs_.set.views.push_back(listed);
      pictures_.push_back(drawn(listed.camera));
    }
    photographs_.picture = [this](int view) { return pictures_.at(static_cast<std::size_t>(view)); };
    start_ = truth_;
    const auto noise = random_floats(g.sh.size(), 6);
    for (std::size_t i = 0; i < noise.size(); ++i) start_.gaussians.sh[i] += 0.4f * noise[i];
    for (std::size_t i = 0; i < start_.gaussians.means.size(); ++i)
      start_.gaussians.means[i] += 0.02f * noise[i % noise.size()];
  }

  // Straight alpha.
  Image drawn(const Camera& camera) {
    RenderOptions options;
    options.near = truth_.near;
    options.background = {0, 0, 0};
    const Picture p = render_picture(ctx(), upload(ctx(), truth_.gaussians), camera, options);
    Image out(camera.width, camera.height, 4);
    for (std::size_t i = 0; i < p.alpha.data.size(); ++i) {
      const float a = p.alpha.data[i];
      for (std::size_t c = 0; c < 3; ++c)
        out.data[4 * i + c] = a > 0 ? std::min(p.colour.data[3 * i + c] / a, 1.0f) : 0;
      out.data[4 * i + 3] = a;
    }
    return out;
  }

  FitStart start() {
    FitStart out;
    out.make = [this](const std::vector<int>& views) {
      asked_.push_back(views);
      return start_;
    };
    return out;
  }

  FitResult run(const FitRequest& request) {
    SceneFit fit(ctx(), photographs_, start(), request);
    while (fit.step()) {
    }
    return fit.result();
  }

  static void expect_finite(const Scene& scene) {
    for (const std::vector<float>* values : {&scene.gaussians.means, &scene.gaussians.scales, &scene.gaussians.quats,
                                             &scene.gaussians.opacities, &scene.gaussians.sh})
      EXPECT_TRUE(std::all_of(values->begin(), values->end(), [](float v) { return std::isfinite(v); }));
  }

  Scene truth_, start_;
  std::vector<Image> pictures_;
  Photographs photographs_;
  std::vector<std::vector<int>> asked_;  // of the start, in order
};

}  // namespace vsplat::test
