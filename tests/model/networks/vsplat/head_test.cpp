// Heads and selection against the PyTorch specification.
#include "model/networks/vsplat/head.h"

#include "model/networks/vsplat/voxel_selection.h"
#include "model/ops/dense/gather.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

using test::close;
using test::close_by_channel;

class HeadStages : public test::FlavourTest {
 protected:
  void expect_gaussians(const DeviceGaussians& g, const test::Golden& golden, const std::string& name) {
    const auto expect = [&](const Tensor& got, const char* field, std::size_t channels, double tolerance) {
      EXPECT_TRUE(close_by_channel(ctx().read<float>(got), golden.floats(name + field), channels, tolerance)) << field;
    };
    expect(g.means, ".means", 3, 1e-5);
    expect(g.scales, ".scales", 3, 1e-5);
    expect(g.quats, ".quats", 4, 1e-4);
    expect(g.opacities, ".opacities", 1, 1e-4);
    expect(g.sh, ".sh", static_cast<std::size_t>(3 * golden.config().sh_count()), 1e-5);
  }
};
VSPLAT_FLAVOURS(HeadStages);

TEST_P(HeadStages, CoarseGaussiansAndSelectionMatchTheSpecification) {
  for (const std::string& name : test::golden_present()) {
    SCOPED_TRACE(name);
    const test::Golden golden = test::Golden::load(name);
    const Config& config = golden.config();
    const CoarseHeads heads(ctx(), config, golden.weights());
    CoarseHeads::Output coarse = heads.forward(ctx(), test::golden_upload(ctx(), golden, "stage.volume"));
    EXPECT_TRUE(close(ctx().read<float>(coarse.logits), golden.floats("stage.logits"), 1e-5));
    if (config.levels != "coarse") {
      SelectionOptions options;
      options.temperature = static_cast<float>(golden.temperature());
      if (golden.has("input.noise")) options.noise = test::golden_upload(ctx(), golden, "input.noise");
      const SelectedVoxels selected = select_voxels(ctx(), config, coarse.logits, coarse.gaussians.opacities, options);
      EXPECT_TRUE(close(ctx().read<float>(selected.factor), golden.floats("stage.confidence"), 1e-4));
      EXPECT_EQ(ctx().read<int>(selected.index), test::golden_index(golden));
      EXPECT_EQ(selected.count, static_cast<long>(test::golden_index(golden).size()));
      coarse.gaussians.opacities = selected.opacities;
      if (config.levels == "skeletal") {
        expect_gaussians(gather_forward(ctx(), coarse.gaussians, selected.index), golden, "stage.final");
      }
    }
    expect_gaussians(coarse.gaussians, golden, "stage.coarse");
  }
}

TEST_P(HeadStages, FineGaussiansMatchTheSpecification) {
  for (const std::string& name : test::golden_present()) {
    SCOPED_TRACE(name);
    const test::Golden golden = test::Golden::load(name);
    if (golden.config().levels != "fine") continue;
    const FineHeads heads(ctx(), golden.config(), golden.weights());
    const std::vector<int> index = test::golden_index(golden);
    const Tensor selected = ctx().upload({static_cast<long>(index.size())}, index, Type::i32);
    const DeviceGaussians skeleton =
        gather_forward(ctx(), test::golden_gaussians(ctx(), golden, "stage.coarse"), selected);
    expect_gaussians(heads.forward(ctx(), test::golden_upload(ctx(), golden, "stage.refined"), skeleton), golden,
                     "stage.final");
  }
}

TEST_P(HeadStages, AForcedSelectionReplacesTheIndicesAndNothingElse) {
  const test::Golden golden = test::Golden::load("micro");
  const Tensor logits = test::golden_upload(ctx(), golden, "stage.logits");
  const Tensor opacities = test::golden_upload(ctx(), golden, "stage.coarse.opacities");
  const std::vector<int> forced = {0, 5, 63};
  SelectionOptions options;
  const SelectedVoxels free = select_voxels(ctx(), golden.config(), logits, opacities, options);
  options.forced = &forced;
  const SelectedVoxels chosen = select_voxels(ctx(), golden.config(), logits, opacities, options);
  EXPECT_EQ(ctx().read<int>(chosen.index), forced);
  EXPECT_EQ(ctx().read<float>(chosen.factor), ctx().read<float>(free.factor));
  EXPECT_EQ(ctx().read<float>(chosen.opacities), ctx().read<float>(free.opacities));
  for (const std::vector<int>& bad : {std::vector<int>{-1}, {64}, {3, 3}, {4, 3}}) {
    options.forced = &bad;
    EXPECT_THROW(select_voxels(ctx(), golden.config(), logits, opacities, options), Error);
  }
}

TEST_P(HeadStages, ASeedMakesARandomButReproducibleSelection) {
  const test::Golden golden = test::Golden::load("micro");
  const Tensor logits = test::golden_upload(ctx(), golden, "stage.logits");
  const Tensor opacities = test::golden_upload(ctx(), golden, "stage.coarse.opacities");
  const auto choose = [&](std::optional<std::uint64_t> seed) {
    SelectionOptions options;
    options.seed = seed;
    return ctx().read<int>(select_voxels(ctx(), golden.config(), logits, opacities, options).index);
  };
  EXPECT_EQ(choose(1), choose(1));
  EXPECT_NE(choose(1), choose(2));
  EXPECT_NE(choose(1), choose({}));
  EXPECT_EQ(choose({}), test::golden_index(golden));
}

TEST_P(HeadStages, RunInAPlan) {
  const test::Golden golden = test::Golden::load("micro");
  const Config& config = golden.config();
  const CoarseHeads coarse_heads(ctx(), config, golden.weights());
  const FineHeads fine_heads(ctx(), config, golden.weights());
  const auto plan = ctx().planner();
  const CoarseHeads::Output coarse = coarse_heads.forward(*plan, plan->tensor({config.voxels(), config.volume_ch}));
  for (const long planned : {0L, 11L}) {
    SelectionOptions options;
    options.planned = planned;
    options.seed = 3;
    const SelectedVoxels selected = select_voxels(*plan, config, coarse.logits, coarse.gaussians.opacities, options);
    EXPECT_EQ(selected.count, planned);
    const DeviceGaussians skeleton = gather_forward(*plan, coarse.gaussians, selected.index);
    EXPECT_EQ(fine_heads.forward(*plan, plan->tensor({planned, config.fine_dim}), skeleton).count(),
              planned * (config.fine_count + 1));
  }
}

}  // namespace
}  // namespace vsplat
