#include "model/fit/fitter.h"

#include <algorithm>
#include <cmath>

#include "model/base/rng.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/diagnose/selftest/reference/sky_background.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/diagnose/selftest/reference/splat_parameters.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/fitter_objective.h"
#include "tests/support/orbit.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using test::byte_of;
using test::Objective;
using test::Parameters;

class FitterTest : public test::FlavourTest {
 protected:
  Parameters read(const SplatParameters& x) {
    return {ctx().read<float>(x.means), ctx().read<float>(x.log_scales), ctx().read<float>(x.quats),
            ctx().read<float>(x.logits), ctx().read<float>(x.sh)};
  }

  // Every Gaussian is wide enough to exceed 1/255 in every pixel, faint enough never to be limited to 0.99, and there
  // are few enough to let light through: no threshold of drawing is near.
  static Gaussians wide_ones() {
    Gaussians g;
    g.count = 5;
    g.sh_degree = 2;
    const std::vector<float> at = test::random_floats(1000, 44);
    for (std::size_t k = 0; k < g.count; ++k) {
      const float* r = &at[60 * k];
      g.means.insert(g.means.end(), {0.3f * r[0], 0.3f * r[1], 0.5f * r[2]});
      g.scales.insert(g.scales.end(), {0.6f + 0.2f * r[3], 0.6f + 0.2f * r[4], 0.6f + 0.2f * r[5]});
      g.quats.insert(g.quats.end(), {r[6], r[7], r[8], 1.5f});
      g.opacities.push_back(0.4f + 0.2f * r[9]);
      for (std::size_t i = 0; i < 27; ++i) g.sh.push_back(0.1f * r[10 + i]);
    }
    return g;
  }

  // A picture that differs from the drawing of `g` in every pixel, over white and over `background`.
  static FitPicture off(const Gaussians& g, const Camera& camera, const ref::Options& drawing,
                        const std::array<double, 3>& background, bool masked) {
    FitPicture out{"", camera, {}, {}, masked};
    const ref::Frame f = ref::render(g, camera, drawing);
    const auto random = test::random_floats(10000, 51, 0, 1);
    std::size_t next = 0;
    for (std::size_t p = 0; p < f.alpha.size(); ++p) {
      const double a = masked ? f.alpha[p] + (p % 2 == 0 && f.alpha[p] < 0.9 ? 0.08 : -0.08) : 1;
      for (std::size_t c = 0; c < 3; ++c) {
        double colour = 0;
        for (int tries = 0; tries < 50; ++tries) {
          colour = a * static_cast<double>(random[next++ % random.size()]);
          const double drawn = f.colour[3 * p + c];  // over white
          const double other = drawn + (1 - f.alpha[p]) * (background[c] - 1);
          if (std::abs(colour + 1 - a - drawn) > 0.04 && std::abs(colour + (1 - a) * background[c] - other) > 0.04)
            break;
        }
        out.rgba.push_back(byte_of(colour));
      }
      out.rgba.push_back(byte_of(a));
    }
    return out;
  }

  // Moves the colours of an unmasked picture away from what is drawn over a sky, and from black and white.
  static void keep_off(FitPicture& picture, const std::vector<double>& shown) {
    for (std::size_t i = 0; i < shown.size(); ++i) {
      std::uint8_t& given = picture.rgba[4 * (i / 3) + i % 3];
      if (std::abs(given / 255.0 - shown[i]) < 0.04) given = byte_of(shown[i] + (shown[i] > 0.5 ? -0.1 : 0.1));
    }
  }

  // Compares the gradient after this many steps with differences of the objective.
  void check_gradient(FitOptions options, int steps, bool masked, bool with_unknown) {
    options.high_scale = 2;  // wider than any of wide_ones()
    const std::array<float, 3> mirror = {0.1f, -0.2f, 0.3f};
    const Camera camera = test::make_camera({"", 0, 0, 13, 11, ""}, 45);
    const Gaussians start = wide_ones();
    ref::Options drawing;
    drawing.near = test::kNear;
    drawing.antialias = options.antialias;
    drawing.mirror = Eigen::Vector3f(0.1f, -0.2f, 0.3f).cast<double>();
    const auto random =
        philox4x32_10({0, static_cast<std::uint32_t>(steps), stream_of("fit.background"), 0}, rng_key(options.seed));
    using Kind = FitBackground::Kind;
    const Kind kind = options.background.kind;
    std::array<double, 3> background{1, 1, 1};
    for (std::size_t c = 0; c < 3; ++c) {
      if (kind == Kind::random || (kind == Kind::automatic && masked && steps % 2 == 1))
        background[c] = static_cast<double>(uniform01(random[c]));
      if (kind == Kind::colour) background[c] = static_cast<double>(options.background.colour[c]);
      if (kind == Kind::sky) background[c] = 0;
    }
    const ref::Left left{static_cast<double>(options.drop), options.seed, static_cast<std::uint32_t>(steps)};
    Gaussians seen = start;
    for (std::size_t k = 0; k < seen.count; ++k)
      seen.opacities[k] = left.out(k) ? 0 : std::min(1.0f, seen.opacities[k] / (1 - options.drop));
    FitPicture picture = off(seen, camera, drawing, background, masked);
    if (with_unknown)
      for (std::size_t i = 0; i < picture.rgba.size() / 4; ++i) picture.known.push_back(i % 5 == 0 ? 0 : 255);
    const DeviceFitPicture given = upload(ctx(), picture);
    Fitter fitter(ctx(), start, test::kNear, mirror, options);
    Camera nearer = camera;
    nearer.fx *= 0.2, nearer.fy *= 0.2;  // pixels that are as large as the Gaussians
    if (options.antialias) fitter.set_cameras({nearer});
    Objective objective{picture, options, drawing, false, {}, read(fitter.parameters())};
    for (int i = 0; i < steps; ++i) fitter.step(given);
    if (kind == Kind::sky) objective.sky = random_sky(fitter);
    Parameters x = read(fitter.parameters());
    objective.drawing.background = background;
    objective.left = left;
    if (kind == Kind::sky) keep_off(picture, objective.render(x).colour);
    const DeviceFitPicture now = upload(ctx(), picture);
    fitter.differentiate(now);
    const GaussianGradients g = fitter.gradient();
    const Parameters got = read({g.means, g.scales, g.quats, g.opacities, g.sh});

    if (options.antialias) objective.variances = fitter.state().at("filter.variances").data;
    objective.similar = options.ssim_weight > 0;
    ASSERT_GT(objective.hold(x), 0.003) << "near a kink";
    const double loss = ref::loss(objective.render(x).colour, objective.target, 11, 13, options.ssim_weight,
                                  {true, true, objective.similar})[0];
    EXPECT_NEAR(ctx().read<float>(fitter.last_loss())[0], loss, 1e-5);

    const auto compare = [&](std::vector<float> Parameters::*member, const char* name, std::size_t channels = 1) {
      std::vector<double> want;
      for (float& value : x.*member) {
        const float base = value;
        const auto slope = [&](float h) {
          const float low = base - h, high = base + h;
          value = high;
          const double above = objective(x);
          value = low;
          const double below = objective(x);
          value = base;
          return (above - below) / (static_cast<double>(high) - static_cast<double>(low));
        };
        want.push_back((4 * slope(0x1p-10f) - slope(0x1p-9f)) / 3);
      }
      EXPECT_TRUE(test::close_by_channel(got.*member, want, channels, 2e-4)) << name;
    };
    compare(&Parameters::means, "means");
    compare(&Parameters::log_scales, "log scales");
    compare(&Parameters::quats, "quats");
    compare(&Parameters::logits, "logits");
    compare(&Parameters::sh, "sh", 27);

    fitter.move();
    EXPECT_EQ(fitter.steps_done(), steps + 1);
    for (const Tensor& t : {g.means, g.scales, g.quats, g.opacities, g.sh})
      EXPECT_EQ(ctx().read<float>(t), std::vector<float>(static_cast<std::size_t>(t.count()), 0.0f));
  }

  // Gives the fitter a sky of random coefficients, and returns them.
  static std::vector<double> random_sky(Fitter& fitter) {
    FitTensors state = fitter.state();
    std::vector<float>& sky = state.at("sky.x").data;
    sky = test::random_floats(75, 9);
    for (float& v : sky) v *= 0.1f;
    fitter.restore(state, fitter.steps_done());
    return {sky.begin(), sky.end()};
  }

  // Pictures of `g`, drawn from around it.
  std::vector<FitPicture> pictures_of(const Gaussians& g, int count, int size) {
    std::vector<FitPicture> out;
    for (const Camera& camera : test::orbit(count, size)) {
      RenderOptions how;
      how.near = test::kNear;
      how.background = {0, 0, 0};
      const Picture drawn = render_picture(ctx(), vsplat::upload(ctx(), g), camera, how);
      FitPicture picture{"", camera, {}, {}, true};
      for (std::size_t i = 0; i < drawn.alpha.data.size(); ++i) {
        const std::uint8_t a = byte_of(drawn.alpha.data[i]);
        for (std::size_t c = 0; c < 3; ++c) picture.rgba.push_back(std::min(a, byte_of(drawn.colour.data[3 * i + c])));
        picture.rgba.push_back(a);
      }
      out.push_back(picture);
    }
    return out;
  }

  std::vector<DeviceFitPicture> uploaded(const std::vector<FitPicture>& pictures) {
    std::vector<DeviceFitPicture> out;
    out.reserve(pictures.size());
    for (const FitPicture& p : pictures) out.push_back(upload(ctx(), p));
    return out;
  }

  static Gaussians scene(std::size_t count, std::uint32_t seed) {
    Gaussians g = test::make_scene({"", count, 1, 0, 0, ""}, seed);
    for (float& v : g.means) v *= 0.5f;
    for (float& v : g.scales) v *= 3;
    for (float& v : g.sh) v *= 0.5f;
    return g;
  }

  // The mean squared error over pictures.
  static double error(Fitter& fitter, const std::vector<DeviceFitPicture>& pictures) {
    double sum = 0;
    for (const auto& p : pictures) sum += std::pow(10, -0.1 * fitter.score(p).psnr);
    return sum / static_cast<double>(pictures.size());
  }

  void expect_finite(Fitter& fitter) {
    const Parameters x = read(fitter.parameters());
    for (const auto* v : {&x.means, &x.log_scales, &x.quats, &x.logits, &x.sh})
      EXPECT_TRUE(std::all_of(v->begin(), v->end(), [](float f) { return std::isfinite(f); }));
    for (const float v : ctx().read<float>(fitter.last_loss())) EXPECT_TRUE(std::isfinite(v));
  }
};
VSPLAT_FLAVOURS(FitterTest);

FitOptions all_terms() {
  FitOptions options;
  options.ssim_weight = 0.3f, options.alpha_weight = 0.4f;
  options.opacity_weight = 0.05f, options.scale_weight = 0.1f, options.pull = 0.2f;
  options.seed = 7;
  return options;
}

TEST_P(FitterTest, GradientMatchesDifferencesAtTheStart) {
  check_gradient(all_terms(), 0, true, false);
  check_gradient(all_terms(), 0, true, true);
  check_gradient(all_terms(), 0, false, true);
}

// With a sloped regulariser, another background, dropped Gaussians, and without the similarity term.
TEST_P(FitterTest, GradientMatchesDifferencesLaterOn) {
  FitOptions options = all_terms();
  check_gradient(options, 3, true, true);
  options.ssim_weight = 0;
  check_gradient(options, 3, true, false);
  check_gradient(options, 2, true, false);
  options.drop = 0.3f;
  check_gradient(options, 4, true, false);
}

TEST_P(FitterTest, GradientMatchesDifferencesWithAntialiasing) {
  FitOptions options = all_terms();
  options.antialias = true;
  check_gradient(options, 0, true, true);
  check_gradient(options, 3, true, false);
}

// Gaussians of a fit's own pictures stay as they are, and finer ones become as wide as a fifth of a pixel.
TEST_P(FitterTest, TheFilterLetsNoGaussianBeFinerThanThePictures) {
  const Camera camera = test::look_at({0, 0, -2}, {0, 0, 0}, {0, -1, 0}, 40, 40, 50);
  Gaussians g = scene(6, 3);
  for (std::size_t k = 0; k < 6; ++k)
    for (std::size_t i = 0; i < 3; ++i) g.means[3 * k + i] *= 0.1f, g.scales[3 * k + i] = k < 3 ? 0.1f : 0.004f;
  FitOptions options;
  options.antialias = true;
  Fitter fitter(ctx(), g, test::kNear, {}, options);
  fitter.set_cameras({camera});
  const Gaussians seen = fitter.gaussians();
  ASSERT_EQ(seen.count, 6u);
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(seen.scales[i], 0.1f, 1e-5);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(seen.opacities[k], g.opacities[k], 1e-4);
  for (std::size_t i = 9; i < 18; ++i) EXPECT_GT(seen.scales[i], 0.2 * 1.9 / 50);
}

TEST_P(FitterTest, GradientMatchesDifferencesOverEachBackground) {
  using Kind = FitBackground::Kind;
  FitOptions options = all_terms();
  for (const Kind kind : {Kind::colour, Kind::random, Kind::sky}) {
    SCOPED_TRACE(static_cast<int>(kind));
    options.background = {kind, {0.2f, 0.9f, 0.4f}};
    check_gradient(options, 3, false, true);
  }
  options.background.kind = Kind::random;
  check_gradient(options, 2, true, false);
}

TEST_P(FitterTest, BringsAFewGaussiansToPicturesOfOthers) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 6, 48));
  FitOptions options;
  options.steps = 300;
  Fitter fitter(ctx(), scene(30, 2), test::kNear, {}, options);
  const double before = error(fitter, pictures);
  for (std::size_t i = 0; i < 300; ++i) fitter.step(pictures[i % 6]);
  const double after = error(fitter, pictures);
  EXPECT_LT(after, before / 8);
  expect_finite(fitter);
}

// Rounding to bytes limits the result to 59 dB.
TEST_P(FitterTest, ScoresAScenesOwnPicturesAsThemselves) {
  const Gaussians g = scene(12, 1);
  const auto pictures = uploaded(pictures_of(g, 3, 40));
  Fitter fitter(ctx(), g, test::kNear, {}, {});
  for (const auto& p : pictures) {
    const FitScore score = fitter.score(p);
    EXPECT_GT(score.psnr, 50);
    EXPECT_GT(score.ssim, 0.999);
  }
}

TEST_P(FitterTest, SameBitsAgainAndOthersWithAnotherSeed) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 4, 40));
  FitOptions options = all_terms();
  options.drop = 0.1f, options.noise = 100;
  options.grow_every = 7, options.grow_until = 100, options.max_gaussians = 60;
  const auto fitted = [&](std::uint64_t seed) {
    options.seed = seed;
    Fitter fitter(ctx(), scene(40, 2), test::kNear, {}, options);
    for (std::size_t i = 0; i < 25; ++i) fitter.step(pictures[i % 4]);
    EXPECT_EQ(fitter.count(), 52);  // 40, 44, 48, 52
    expect_finite(fitter);
    return fitter.gaussians();
  };
  const Gaussians first = fitted(1), again = fitted(1), other = fitted(2);
  EXPECT_EQ(first.means, again.means);
  EXPECT_EQ(first.scales, again.scales);
  EXPECT_EQ(first.quats, again.quats);
  EXPECT_EQ(first.opacities, again.opacities);
  EXPECT_EQ(first.sh, again.sh);
  EXPECT_NE(first.means, other.means);
}

TEST_P(FitterTest, GrowsToItsLimitAndUntilItsEnd) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 1, 24));
  FitOptions options;
  options.grow_every = 2, options.grow_until = 7, options.growth = 1.5, options.max_gaussians = 40;
  Fitter fitter(ctx(), scene(20, 2), test::kNear, {}, options);
  std::vector<long> counts;
  for (int i = 0; i < 9; ++i) fitter.step(pictures[0]), counts.push_back(fitter.count());
  EXPECT_EQ(counts, (std::vector<long>{20, 30, 30, 40, 40, 40, 40, 40, 40}));
  options.max_gaussians = 1000;
  Fitter further(ctx(), scene(20, 2), test::kNear, {}, options);
  for (int i = 0; i < 9; ++i) further.step(pictures[0]);
  EXPECT_EQ(further.count(), 67);  // after 2, 4 and 6 steps
  expect_finite(further);
}

TEST_P(FitterTest, ColoursComeFirstWhereThatIsAskedFor) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 1, 24));
  FitOptions options;
  options.colours_first = 3;
  Fitter fitter(ctx(), scene(20, 2), test::kNear, {}, options);
  const Parameters start = read(fitter.parameters());
  for (int i = 0; i < 3; ++i) fitter.step(pictures[0]);
  const Parameters third = read(fitter.parameters());
  EXPECT_EQ(third.means, start.means);
  EXPECT_EQ(third.log_scales, start.log_scales);
  EXPECT_EQ(third.quats, start.quats);
  EXPECT_NE(third.logits, start.logits);
  EXPECT_NE(third.sh, start.sh);
  fitter.step(pictures[0]);
  EXPECT_NE(read(fitter.parameters()).means, start.means);
}

TEST_P(FitterTest, OnePictureIsFittedAsItIs) {
  auto given = pictures_of(scene(12, 1), 1, 40);
  for (const bool masked : {true, false}) {
    given[0].masked = masked;
    if (!masked)  // over white
      for (std::size_t i = 0; i < given[0].rgba.size(); i += 4) {
        for (std::size_t c = 0; c < 3; ++c)
          given[0].rgba[i + c] = static_cast<std::uint8_t>(given[0].rgba[i + c] + 255 - given[0].rgba[i + 3]);
        given[0].rgba[i + 3] = 255;
      }
    const auto pictures = uploaded(given);
    Fitter fitter(ctx(), scene(30, 2), test::kNear, {}, {});
    const double before = error(fitter, pictures);
    for (int i = 0; i < 100; ++i) fitter.step(pictures[0]);
    EXPECT_LT(error(fitter, pictures), before / 20) << masked;
  }
}

// Empty masks: existing Gaussians fade, and nothing fails, including relocation and noise.
TEST_P(FitterTest, EmptyMasksLeaveNothingToSee) {
  auto given = pictures_of(scene(12, 1), 2, 24);
  for (FitPicture& p : given) std::fill(p.rgba.begin(), p.rgba.end(), std::uint8_t{0});
  const auto pictures = uploaded(given);
  FitOptions options;
  options.rates.logits = 0.2;
  options.grow_every = 10, options.grow_until = 1000, options.noise = 100;
  Fitter fitter(ctx(), scene(12, 1), test::kNear, {}, options);
  const double before = error(fitter, pictures);
  for (std::size_t i = 0; i < 120; ++i) fitter.step(pictures[i % 2]);
  EXPECT_LT(error(fitter, pictures), before / 100);
  expect_finite(fitter);
}

// A picture without valid pixels has no effect.
TEST_P(FitterTest, UnknownPixelsMoveNothing) {
  auto given = pictures_of(scene(12, 1), 1, 24);
  given[0].known.assign(24 * 24, 0);
  const auto pictures = uploaded(given);
  Fitter fitter(ctx(), scene(20, 2), test::kNear, {}, {});
  const Parameters start = read(fitter.parameters());
  for (int i = 0; i < 3; ++i) fitter.step(pictures[0]);
  const Parameters x = read(fitter.parameters());
  EXPECT_TRUE(test::close(x.means, start.means, 1e-6));
  EXPECT_TRUE(test::close(x.logits, start.logits, 1e-6));
  EXPECT_TRUE(test::close(x.sh, start.sh, 1e-6));
}

TEST_P(FitterTest, AStartWithNoGaussianStaysOne) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 1, 24));
  for (const long room : {0L, 50L}) {
    FitOptions options = all_terms();
    options.grow_every = 1, options.grow_until = 10, options.max_gaussians = room, options.noise = 1;
    Fitter fitter(ctx(), Gaussians{}, test::kNear, {}, options);
    for (int i = 0; i < 3; ++i) fitter.step(pictures[0]);
    EXPECT_EQ(fitter.count(), 0);
    EXPECT_EQ(fitter.gaussians().count, 0U);
    EXPECT_GT(fitter.score(pictures[0]).psnr, 0);
    expect_finite(fitter);
  }
}

// Scales of 0 and far too large ones, opacities of 0 and 1, Gaussians behind and inside the cameras, at ten times the
// rates: results stay finite and within the limits.
TEST_P(FitterTest, IsNeverNan) {
  const auto pictures = uploaded(pictures_of(scene(12, 1), 4, 33));
  Gaussians start = scene(60, 3);
  for (std::size_t i = 0; i < 30; ++i) start.scales[i] = i % 3 == 0 ? 0.0f : 1e3f;
  for (std::size_t k = 20; k < 30; ++k) start.opacities[k] = static_cast<float>(k % 2);
  for (std::size_t i = 90; i < 120; ++i) start.means[i] *= 20;
  FitOptions options = all_terms();
  options.rates = {1e-2, 0.1, 2e-2, 0.3, 5e-2, 5e-3};
  options.grow_every = 10, options.grow_until = 1000, options.max_gaussians = 100, options.noise = 1e4f;
  options.drop = 0.5f, options.steps = 60;
  Fitter fitter(ctx(), start, test::kNear, {}, options);
  for (std::size_t i = 0; i < 57; ++i) fitter.step(pictures[i % 4]);  // the last relocation was some steps ago
  expect_finite(fitter);
  const Gaussians out = fitter.gaussians();
  EXPECT_GT(out.count, 0U);
  for (const float s : out.scales) {
    EXPECT_GE(s, 0.999f * options.low_scale);
    EXPECT_LE(s, 1.001f * options.high_scale);
  }
  for (std::size_t k = 0; k < out.count; ++k) {
    EXPECT_GE(out.opacities[k], 1.0f / 255);
    double length = 0;
    for (std::size_t i = 4 * k; i < 4 * k + 4; ++i) length += static_cast<double>(out.quats[i]) * out.quats[i];
    EXPECT_NEAR(length, 1, 1e-5);
  }
}

}  // namespace
}  // namespace vsplat
