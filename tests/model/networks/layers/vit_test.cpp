// Encoder, modulation and lifting against the PyTorch specification.
#include "model/networks/layers/vit.h"

#include "model/networks/vsplat/fused_lift.h"
#include "model/networks/vsplat/pose_modulation.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

Tensor images_of(Context& ctx, const test::Golden& golden) {
  const long size = golden.config().image, views = golden.views();
  auto images = golden.floats("input.images");
  images.resize(static_cast<std::size_t>(views * size * size * 3));
  return ctx.upload({views, size, size, 3}, images);
}

class Encoder : public test::FlavourTest {
 protected:
  // Relative to the largest value of each tensor. 1e-4 is the project's bound for a stage; float32 is well within it.
  void expect_match(const std::string& name) {
    const test::Golden golden = test::Golden::load(name);
    const Config& config = golden.config();
    const DeviceCameras cameras = upload_cameras(ctx(), test::golden_cameras(golden));
    const Vit vit(ctx(), config.encoder_sizes(), golden.weights());
    const PoseModulation modulation(ctx(), config, golden.weights());
    const Lifting lifting(ctx(), config, golden.weights());
    const Tensor features = modulation.forward(ctx(), vit.forward(ctx(), images_of(ctx(), golden)), cameras);
    EXPECT_EQ(features.shape(), (Shape{golden.views(), config.tokens(), config.tokens(), config.vit_dim}));
    EXPECT_TRUE(test::close_by_channel(ctx().read<float>(features), golden.floats("stage.features"),
                                       static_cast<std::size_t>(config.vit_dim), 2e-5))
        << name;
    const Tensor lifted = lifting.forward(ctx(), features, cameras);
    EXPECT_EQ(lifted.shape(), (Shape{config.voxels(), 4 * config.volume_ch}));
    EXPECT_TRUE(test::close_by_channel(ctx().read<float>(lifted), test::golden_compressed(golden),
                                       static_cast<std::size_t>(lifted.shape().back()), 2e-5))
        << name;
  }
};
VSPLAT_FLAVOURS(Encoder);

TEST_P(Encoder, MatchesPyTorchOnMicro) { expect_match("micro"); }

// Made by PyTorch when the tests run. "tiny_paper" samples without the half pixel.
TEST_P(Encoder, MatchesPyTorchOnTiny) {
  for (const std::string name : {"tiny", "tiny_seed1", "tiny_views1", "tiny_views6", "tiny_paper"}) {
    VSPLAT_NEED_GOLDEN(name);
    expect_match(name);
  }
}

// A plan runs the same code without launching anything, and counts at least what the run takes.
TEST_P(Encoder, PlansItsMemory) {
  const test::Golden golden = test::Golden::load("micro");
  const auto own = test::open_context(GetParam());
  const Vit vit(*own, golden.config().encoder_sizes(), golden.weights());
  const Lifting lifting(*own, golden.config(), golden.weights());
  const PoseModulation modulation(*own, golden.config(), golden.weights());
  const DeviceCameras cameras = upload_cameras(*own, test::golden_cameras(golden));
  const Tensor images = images_of(*own, golden);
  const auto planner = own->planner();
  lifting.forward(*planner, modulation.forward(*planner, vit.forward(*planner, images), cameras), cameras);
  const std::size_t planned = planner->memory().peak_live();
  lifting.forward(*own, modulation.forward(*own, vit.forward(*own, images), cameras), cameras);
  own->finish();
  EXPECT_EQ(own->memory().peak_live(), planned);
}

TEST_P(Encoder, IsDeterministic) {
  const test::Golden golden = test::Golden::load("micro");
  const Vit vit(ctx(), golden.config().encoder_sizes(), golden.weights());
  const Lifting lifting(ctx(), golden.config(), golden.weights());
  const PoseModulation modulation(ctx(), golden.config(), golden.weights());
  const DeviceCameras cameras = upload_cameras(ctx(), test::golden_cameras(golden));
  const auto run = [&] {
    const Tensor tokens = vit.forward(ctx(), images_of(ctx(), golden));
    return ctx().read<float>(lifting.forward(ctx(), modulation.forward(ctx(), tokens, cameras), cameras));
  };
  EXPECT_EQ(run(), run());
}

TEST_P(Encoder, NamesAMissingWeightAndAWrongShape) {
  const test::Golden golden = test::Golden::load("micro");
  Weights weights = golden.weights();
  const std::string name = "encoder.model.blocks.0.attn.qkv.weight";
  weights.set(name, {{3, 4}, std::vector<float>(12)});
  test::expect_error(Status::format, {name}, [&] { const Vit vit(ctx(), golden.config().encoder_sizes(), weights); });
  EXPECT_THROW(Lifting(ctx(), golden.config(), Weights()), Error);
}

}  // namespace
}  // namespace vsplat
