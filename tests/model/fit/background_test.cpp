#include "model/fit/background.h"

#include <algorithm>
#include <cmath>

#include "model/diagnose/selftest/reference/sky_background.h"
#include "model/fit/fitter.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

constexpr float kSkyNear = 0.05f;

class Background : public test::FlavourTest {};
VSPLAT_FLAVOURS(Background);

Gaussians round_one(float opacity, float size, float sh) {
  Gaussians out;
  out.count = 1;
  out.means = {0, 0, 0};
  out.scales = {size, size, size};
  out.quats = {1, 0, 0, 0};
  out.opacities = {opacity};
  out.sh = {sh, sh, sh};
  return out;
}

// A single picture of a colour, seen by a camera at (0, 0, -2).
FitPicture plain_picture(const std::array<std::uint8_t, 3>& colour, int size) {
  FitPicture out{"", test::orbit(1, size).at(0), {}, {}, false};
  for (int i = 0; i < size * size; ++i) out.rgba.insert(out.rgba.end(), {colour[0], colour[1], colour[2], 255});
  return out;
}

TEST_P(Background, IsMeasuredOverItsBackground) {
  using Kind = FitBackground::Kind;
  const DeviceFitPicture blue = upload(ctx(), plain_picture({0, 102, 255}, 24));
  const auto over = [&](const FitBackground& background) {
    FitOptions options;
    options.background = background;
    return Fitter(ctx(), Gaussians{}, kSkyNear, {}, options).score(blue).psnr;
  };
  const auto off = [](double r, double g, double b) { return -10 * std::log10((r * r + g * g + b * b) / 3); };
  EXPECT_GT(over({Kind::colour, {0, 0.4f, 1}}), 100);
  EXPECT_NEAR(over({}), off(1, 0.6, 0), 1e-4);
  EXPECT_NEAR(over({Kind::random, {}}), off(0, 0.4, 1), 1e-4);
  EXPECT_NEAR(over({Kind::sky, {}}), off(0.5, 0.1, 0.5), 1e-4);
}

// Pixels of which nothing is known do not count as good ones.
TEST_P(Background, OnlyKnownPixelsAreMeasured) {
  FitPicture picture = plain_picture({128, 128, 128}, 40);
  FitOptions options;
  options.background = {FitBackground::Kind::colour, {0, 0, 0}};
  Fitter fitter(ctx(), Gaussians{}, kSkyNear, {}, options);
  const FitScore whole = fitter.score(upload(ctx(), picture));
  for (std::size_t i = 0; i < 1600; ++i) picture.known.push_back(i % 40 < 30 ? 1 : 0);
  const FitScore part = fitter.score(upload(ctx(), picture));
  EXPECT_NEAR(part.psnr, whole.psnr, 1e-4);
  EXPECT_NEAR(part.ssim, whole.ssim, 0.05);
}

// A faint Gaussian before the white that its picture was drawn over need not change; before random colours it becomes
// opaque.
TEST_P(Background, RandomBackgroundsLeaveNoHoles) {
  const Gaussians start = round_one(0.4f, 0.5f, 0.3f / 0.2820948f);
  FitPicture picture = plain_picture({0, 0, 0}, 24);
  RenderOptions how;
  how.near = kSkyNear;
  const Picture drawn = render_picture(ctx(), vsplat::upload(ctx(), start), picture.camera, how);
  for (std::size_t i = 0; i < drawn.colour.data.size(); ++i)
    picture.rgba[i / 3 * 4 + i % 3] = static_cast<std::uint8_t>(std::lround(255 * drawn.colour.data[i]));
  const DeviceFitPicture given = upload(ctx(), picture);
  const auto opacity = [&](FitBackground::Kind kind) {
    FitOptions options;
    options.background.kind = kind;
    Fitter fitter(ctx(), start, kSkyNear, {}, options);
    for (int i = 0; i < 200; ++i) fitter.step(given);
    return fitter.gaussians().opacities.at(0);
  };
  EXPECT_NEAR(opacity(FitBackground::Kind::automatic), 0.4f, 0.1f);
  EXPECT_GT(opacity(FitBackground::Kind::random), 0.8f);
}

// The root mean square of the slope of a picture's colours, by radians near its middle.
double slope(const std::vector<double>& colours, const Camera& camera) {
  double sum = 0;
  int count = 0;
  const auto at = [&](int x, int y, int c) {
    const auto row = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(y);
    return colours[3 * (row + static_cast<std::size_t>(x)) + static_cast<std::size_t>(c)];
  };
  for (int y = 0; y + 1 < camera.height; ++y)
    for (int x = 0; x + 1 < camera.width; ++x)
      for (int c = 0; c < 3; ++c, ++count)
        sum += std::pow((at(x + 1, y, c) - at(x, y, c)) * camera.fx, 2) +
               std::pow((at(x, y + 1, c) - at(x, y, c)) * camera.fy, 2);
  return std::sqrt(sum / count);
}

// One faint Gaussian before a sky: the sky is learnt, and the Gaussians that it becomes look like it.
TEST_P(Background, LearnsASkyAndWritesIt) {
  std::vector<double> sky(75, 0.0);
  sky[0] = 0.4, sky[5] = -0.3, sky[20] = 0.15, sky[62] = 0.1;
  std::vector<FitPicture> given;
  for (const Camera& camera : test::orbit(6, 24)) {
    FitPicture picture{"", camera, {}, {}, false};
    const auto colours = ref::sky(sky, camera);
    for (std::size_t i = 0; i < colours.size(); ++i) {
      picture.rgba.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(colours[i], 0.0, 1.0))));
      if (i % 3 == 2) picture.rgba.push_back(255);
    }
    given.push_back(picture);
  }
  std::vector<DeviceFitPicture> pictures;
  pictures.reserve(given.size());
  for (const FitPicture& picture : given) pictures.push_back(upload(ctx(), picture));
  FitOptions options;
  options.background.kind = FitBackground::Kind::sky;
  Fitter fitter(ctx(), round_one(0.02f, 0.1f, 0), kSkyNear, {}, options);
  const double before = fitter.score(pictures[0]).psnr;
  for (std::size_t i = 0; i < 400; ++i) fitter.step(pictures[i % 6]);
  const Gaussians written = fitter.gaussians();
  ASSERT_GE(written.count, static_cast<std::size_t>(kSkyGaussians));
  // A pixel's colour is that of directions to which a Gaussian reaches, up to opacity 1/255, and the sphere is seen
  // from 1.6 beside its centre: the written sky is displaced by at most as much.
  const double reach = std::sqrt(4 * M_PI / kSkyGaussians) * std::sqrt(2 * std::log(0.9 * 255)) + 1.6 / 100;
  const auto off = [](const FitScore& score) { return std::pow(10, -score.psnr / 20); };
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    const FitScore learnt = fitter.score(pictures[i]), after = fitter.score(written, pictures[i]);
    EXPECT_GT(learnt.psnr, std::max(before + 10, 32.0));
    EXPECT_LT(off(after), off(learnt) + reach * slope(ref::sky(sky, given[i].camera), given[i].camera));
  }
}

// From cameras in the middle of the sphere and beside it: mid grey everywhere.
TEST_P(Background, TheSkysGaussiansLeaveNoGaps) {
  const Gaussians sky = Sky(ctx()).gaussians(ctx(), {{0.3, 0, -0.2}, 100}, 1);
  RenderOptions how;
  how.near = kSkyNear;
  how.background = {0, 0, 0};
  for (const Camera& camera : test::orbit(5, 48)) {
    const Picture drawn = render_picture(ctx(), vsplat::upload(ctx(), sky), camera, how);
    EXPECT_GT(*std::min_element(drawn.alpha.data.begin(), drawn.alpha.data.end()), 0.998f);
    for (const float v : drawn.colour.data) ASSERT_NEAR(v, 0.5f, 0.002f);
  }
}

}  // namespace
}  // namespace vsplat
