// What anti-aliasing is for: a fitted scene drawn smaller than its pictures.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "model/base/resample.h"
#include "model/fit/fitter.h"
#include "model/render/supersample.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

constexpr int kFineSize = 64, kFiner = 4;
constexpr float kFineNear = 0.05f;

// A ball of small Gaussians in random colours: finer than a pixel of the pictures.
Gaussians fine_scene(std::size_t count, std::uint32_t seed) {
  Gaussians g;
  g.count = count;
  const auto random = test::random_floats(count * 8, seed, -1, 1);
  for (std::size_t k = 0; k < count; ++k) {
    const float* r = &random[8 * k];
    for (int i = 0; i < 3; ++i) g.means.push_back(0.4f * r[i]);
    for (int i = 0; i < 3; ++i) g.scales.push_back(0.008f + 0.004f * r[3 + i]);
    for (const float q : {1.0f, r[6], r[7], 0.0f}) g.quats.push_back(q);
    g.opacities.push_back(0.9f);
    for (int i = 0; i < 3; ++i) g.sh.push_back(3 * r[static_cast<std::size_t>(5 + i)]);
  }
  return g;
}

std::size_t index_of(int x, int y, int width, int c) {
  return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)) +
         static_cast<std::size_t>(c);
}

// [H,W,3] means over squares of n x n pixels.
std::vector<double> smaller(const std::vector<float>& pixels, int width, int n) {
  const int out = width / n;
  std::vector<double> sums(index_of(0, out, out, 0));
  for (int y = 0; y < out * n; ++y)
    for (int x = 0; x < out * n; ++x)
      for (int c = 0; c < 3; ++c)
        sums[index_of(x / n, y / n, out, c)] += static_cast<double>(pixels[index_of(x, y, width, c)]) / (n * n);
  return sums;
}

class Antialias : public ::testing::Test {
 protected:
  static Context& ctx() { return test::context(Flavour::cpu); }

  static std::vector<float> drawn(const Gaussians& g, const Camera& camera, bool antialias) {
    RenderOptions how;
    how.near = kFineNear;
    how.antialias = antialias;
    return render_picture(ctx(), upload(ctx(), g), camera, how).colour.data;
  }

  void SetUp() override {
    const Gaussians truth = fine_scene(1500, 1);
    cameras_ = test::orbit(8, kFineSize);
    for (const Camera& camera : cameras_) {
      const auto mean = smaller(drawn(truth, times_as_large(camera, kFiner), false), kFineSize * kFiner, kFiner);
      photographs_.emplace_back(mean.begin(), mean.end());
      FitPicture picture{"", camera, {}, {}, false};
      for (std::size_t i = 0; i < mean.size(); ++i) {
        picture.rgba.push_back(static_cast<std::uint8_t>(std::lround(255 * std::min(mean[i], 1.0))));
        if (i % 3 == 2) picture.rgba.push_back(255);
      }
      pictures_.push_back(upload(ctx(), picture));
    }
  }

  Gaussians fitted(bool antialias) {
    FitOptions options;
    options.steps = 300;
    options.antialias = antialias;
    Fitter fitter(ctx(), fine_scene(1500, 2), kFineNear, {}, options);
    if (antialias) fitter.set_cameras(cameras_);
    for (std::size_t i = 0; i < 300; ++i) fitter.step(pictures_[i % pictures_.size()]);
    return fitter.gaussians();
  }

  // PSNR over all pictures, drawn at 1 / n of their size.
  double psnr(const Gaussians& g, bool antialias, int n) const {
    double sum = 0;
    std::size_t values = 0;
    for (std::size_t v = 0; v < cameras_.size(); ++v) {
      Camera camera = cameras_[v];
      camera.width /= n, camera.height /= n;
      camera.fx /= n, camera.fy /= n, camera.cx /= n, camera.cy /= n;
      const auto got = drawn(g, camera, antialias);
      const auto want = smaller(photographs_[v], kFineSize, n);
      for (std::size_t i = 0; i < want.size(); ++i) sum += (got[i] - want[i]) * (got[i] - want[i]);
      values += want.size();
    }
    return -10 * std::log10(sum / static_cast<double>(values));
  }

  std::vector<Camera> cameras_;
  std::vector<std::vector<float>> photographs_;
  std::vector<DeviceFitPicture> pictures_;
};

TEST_F(Antialias, SmallerPicturesAreAtLeastOneDecibelBetter) {
  const Gaussians with = fitted(true), without = fitted(false);
  for (const int n : {2, 4}) EXPECT_GT(psnr(with, true, n), psnr(without, false, n) + 1) << "1 / " << n;
  EXPECT_GT(psnr(with, true, 1), psnr(without, false, 1) - 0.5);
}

}  // namespace
}  // namespace vsplat
