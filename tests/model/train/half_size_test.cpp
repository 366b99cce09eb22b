// Views that are drawn and compared at half size.
#include "model/train/half_size.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/networks/params/init.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/ops/networks/lift.h"
#include "model/render/render.h"
#include "model/train/trainer.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

using test::Golden;

TEST(HalfSize, PixelsAreMeansOfFour) {
  const std::vector<float> picture = {0, 1, 2, 3,  //
                                      4, 5, 6, 7,  //
                                      8, 8, 1, 0,  //
                                      8, 8, 0, 0};
  EXPECT_EQ(half_size(picture.data(), 4, 1), (std::vector<float>{2.5f, 4.5f, 8, 0.25f}));
  const std::vector<std::uint8_t> rgba = {255, 0, 10, 255, 254, 0, 10, 255, 255, 1, 11, 255, 255, 1, 11, 254};
  EXPECT_EQ(half_size(rgba, 2, 4), (std::vector<std::uint8_t>{255, 1, 11, 255}));
}

TEST(HalfSize, TheCameraSeesTheSame) {
  Camera camera;
  camera.width = 40, camera.height = 24, camera.fx = 33, camera.fy = 31, camera.cx = 21.5, camera.cy = 11;
  const Camera half = half_size(camera);
  EXPECT_EQ(half.width, 20);
  EXPECT_EQ(half.height, 12);
  // Pixel (12.5, 7.5) and the three around the same corner become pixel (6.5, 4) at half size.
  const double x = (13 - camera.cx) / camera.fx, y = (8 - camera.cy) / camera.fy;
  EXPECT_NEAR(half.fx * x + half.cx, 6.5, 1e-12);
  EXPECT_NEAR(half.fy * y + half.cy, 4, 1e-12);
}

TEST(HalfSize, ShareOfTheViews) {
  const auto count = [](double share, std::uint64_t seed, const char* object) {
    int halves = 0;
    for (std::uint32_t draw = 0; draw < 1000; ++draw)
      for (long view = 0; view < 8; ++view) halves += is_half_size(share, seed, draw, object, view);
    return halves;
  };
  EXPECT_EQ(count(0, 1, "cup"), 0);
  EXPECT_EQ(count(1, 1, "cup"), 8000);
  EXPECT_NEAR(count(0.3, 1, "cup"), 2400, 150);
  EXPECT_NE(count(0.3, 2, "cup"), count(0.3, 1, "cup"));
  EXPECT_NE(count(0.3, 1, "pot"), count(0.3, 1, "cup"));
}

// Two input views and two others of 24 pixels, with values that do not repeat.
TrainingViews views_of_24() {
  const Golden golden = Golden::load("micro");
  TrainingViews out;
  out.object = "golden";
  out.inputs = golden.views();
  for (Camera camera : test::golden_all_cameras(golden)) {
    const double scale = 24.0 / camera.width;
    camera.width = camera.height = 24;
    camera.fx *= scale, camera.fy *= scale, camera.cx *= scale, camera.cy *= scale;
    out.cameras.push_back(camera);
  }
  out.pictures = test::random_floats(24 * 24 * 3 * out.cameras.size(), 5, 0.0f, 1.0f);
  return out;
}

Checkpoint start_with(double share) {
  Checkpoint out;
  out.config.model = with_fields(named_config("micro"), {"image=24"});
  out.config.inputs_min = out.config.inputs_max = 2;
  out.config.schedule = {1e-9, 5, 80, 0.1, 0.1, 1};
  out.config.half_size = share;
  out.parameters = initial_weights(out.config.model, 3);
  return out;
}

class HalfSizeTraining : public test::FlavourTest {};
VSPLAT_FLAVOURS(HalfSizeTraining);

// The error that a step reports, compared with pictures drawn here.
TEST_P(HalfSizeTraining, ComparesWithMeansOfFour) {
  const TrainingViews views = views_of_24();
  const Checkpoint start = start_with(1);
  const Config& config = *start.config.model.as<Config>();
  const std::vector<float> still(static_cast<std::size_t>(start.config.model.noise()), 0.0f);
  const auto inputs = static_cast<std::size_t>(views.inputs);
  Trainer trainer(ctx(), start);
  const StepReport report = trainer.step({{&views, views.background, &still}});

  const VsplatModel model(ctx(), config, start.parameters);
  const ForwardResult scene =
      model.forward(ctx(), ctx().upload({views.inputs, 24, 24, 3}, views.pictures.data()),
                    upload_cameras(ctx(), {views.cameras.begin(), views.cameras.begin() + views.inputs}), {});
  double error = 0;
  for (std::size_t v = inputs; v < views.cameras.size(); ++v) {
    Camera camera = views.cameras[v];
    camera.width = camera.height = 12;
    camera.fx /= 2, camera.fy /= 2, camera.cx /= 2, camera.cy /= 2;
    RenderOptions options;
    options.background = views.background;
    options.near = static_cast<float>(kNearInObject);
    const std::vector<float> drawn = ctx().read<float>(render(ctx(), {scene.final}, camera, options).colour);
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      const std::size_t c = i % 3, x = i / 3 % 12, y = i / 36;
      double mean = 0;
      for (const std::size_t at : {48 * y + 2 * x, 48 * y + 2 * x + 1, 48 * y + 24 + 2 * x, 48 * y + 25 + 2 * x})
        mean += static_cast<double>(views.pictures[(v * 24 * 24 + at) * 3 + c]) / 4;
      error +=
          std::pow(std::clamp(static_cast<double>(drawn[i]), 0.0, 1.0) - mean, 2) / static_cast<double>(drawn.size());
    }
  }
  error /= static_cast<double>(views.cameras.size() - inputs);
  EXPECT_NEAR(report.psnr, -10 * std::log10(error), 1e-3);
}

TEST_P(HalfSizeTraining, FollowsFromTheSeedAndTheStep) {
  const TrainingViews views = views_of_24();
  const auto losses = [&](double share) {
    Trainer trainer(ctx(), start_with(share));
    std::vector<double> out;
    out.reserve(3);
    for (int i = 0; i < 3; ++i) out.push_back(trainer.step({{&views, views.background}}).loss);
    return out;
  };
  const auto some = losses(0.5);
  EXPECT_EQ(losses(0.5), some);
  EXPECT_NE(losses(0), some);
  EXPECT_NE(losses(1), some);
}

}  // namespace
}  // namespace vsplat
