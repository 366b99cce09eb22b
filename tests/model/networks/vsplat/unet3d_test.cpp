// The volume network against the PyTorch specification.
#include "model/networks/vsplat/unet3d.h"

#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

class VolumeStage : public test::FlavourTest {};
VSPLAT_FLAVOURS(VolumeStage);

TEST_P(VolumeStage, MatchesTheSpecification) {
  // The other cases have the networks and inputs of "tiny".
  for (const char* name :
       {"micro", "micro_noise", "micro_levels1", "micro_levels3", "tiny", "tiny_seed1", "tiny_views1", "tiny_paper"}) {
    if (!test::Golden::exists(name)) continue;
    const test::Golden golden = test::Golden::load(name);
    const Config& config = golden.config();
    const VolumeNetwork network(ctx(), config, golden.weights());
    Tensor volume = ctx().upload({config.voxels(), 4L * config.volume_ch}, test::golden_compressed(golden));
    const Tensor out = network.forward(ctx(), std::move(volume));
    EXPECT_TRUE(test::close_by_channel(ctx().read<float>(out), golden.floats("stage.volume"),
                                       static_cast<std::size_t>(out.shape().back()), 1e-4))
        << name;
  }
}

TEST_P(VolumeStage, GivesItsMemoryBackAndSaysTheSameTwice) {
  const test::Golden golden = test::Golden::load("micro");
  const Config& config = golden.config();
  const VolumeNetwork network(ctx(), config, golden.weights());
  const std::vector<float> in = test::golden_compressed(golden);
  const auto run = [&] {
    return ctx().read<float>(network.forward(ctx(), ctx().upload({config.voxels(), 4L * config.volume_ch}, in)));
  };
  const std::size_t before = ctx().memory().live();
  const std::vector<float> first = run();
  EXPECT_EQ(ctx().memory().live(), before);
  EXPECT_EQ(first, run());
}

TEST_P(VolumeStage, RunsInAPlan) {
  const test::Golden golden = test::Golden::load("micro");
  const VolumeNetwork network(ctx(), golden.config(), golden.weights());
  const auto plan = ctx().planner();
  const Tensor out = network.forward(*plan, plan->tensor({golden.config().voxels(), 4L * golden.config().volume_ch}));
  EXPECT_EQ(out.shape(), (Shape{golden.config().voxels(), golden.config().volume_ch}));
  EXPECT_GT(plan->memory().peak_live(), 0u);
}

TEST_P(VolumeStage, RejectsBadShape) {
  const test::Golden golden = test::Golden::load("micro");
  const VolumeNetwork network(ctx(), golden.config(), golden.weights());
  EXPECT_THROW(network.forward(ctx(), ctx().tensor({63, 16})), Error);
}

}  // namespace
}  // namespace vsplat
