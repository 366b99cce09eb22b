// The fine stage's features against the PyTorch specification.
#include "model/networks/vsplat/voxel_refiner.h"

#include "model/ops/dense/gather.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

class RefinementStage : public test::FlavourTest {};
VSPLAT_FLAVOURS(RefinementStage);

TEST_P(RefinementStage, MatchesTheSpecification) {
  int cases = 0;
  for (const std::string& name : test::golden_present()) {
    SCOPED_TRACE(name);
    const test::Golden golden = test::Golden::load(name);
    const Config& config = golden.config();
    if (config.levels != "fine") continue;
    const Refinement refinement(ctx(), config, golden.weights());
    const DeviceCameras cameras = upload_cameras(ctx(), test::golden_cameras(golden));
    const std::vector<int> index = test::golden_index(golden);
    const long p = static_cast<long>(index.size());
    Refinement::Input in;
    in.volume = test::golden_upload(ctx(), golden, "stage.volume");
    in.features = test::golden_upload(ctx(), golden, "stage.features");
    in.cameras = &cameras;
    in.index = ctx().upload({p}, index, Type::i32);
    in.means = gather_forward(ctx(), test::golden_gaussians(ctx(), golden, "stage.coarse"), in.index).means;
    const Refinement::Output out = refinement.forward(ctx(), in);
    EXPECT_EQ(out.refined.shape(), (Shape{p, config.fine_dim}));
    EXPECT_TRUE(test::close_by_channel(ctx().read<float>(out.refined), golden.floats("stage.refined"),
                                       static_cast<std::size_t>(out.refined.shape().back()), 1e-4));
    EXPECT_EQ(static_cast<bool>(out.projected), config.use_projected);
    if (config.use_projected) {
      EXPECT_TRUE(test::close_by_channel(ctx().read<float>(out.projected), golden.floats("stage.projected"),
                                         static_cast<std::size_t>(out.projected.shape().back()), 1e-4));
    }
    ++cases;
  }
  EXPECT_GE(cases, 2);
}

TEST_P(RefinementStage, NoVoxelSelectedAndRunningInAPlan) {
  const test::Golden golden = test::Golden::load("micro");
  const Config& config = golden.config();
  const Refinement refinement(ctx(), config, golden.weights());
  const DeviceCameras cameras = upload_cameras(ctx(), test::golden_cameras(golden));
  const auto run = [&](Context& context, long p) {
    Refinement::Input in;
    in.volume = context.tensor({config.voxels(), config.volume_ch});
    in.features = context.tensor({golden.views(), config.tokens(), config.tokens(), config.vit_dim});
    in.cameras = &cameras;
    in.index = context.tensor({p}, Type::i32);
    in.means = context.tensor({p, 3});
    return refinement.forward(context, in).refined.shape();
  };
  EXPECT_EQ(run(ctx(), 0), (Shape{0, config.fine_dim}));
  EXPECT_EQ(run(*ctx().planner(), 0), (Shape{0, config.fine_dim}));
  EXPECT_EQ(run(*ctx().planner(), 17), (Shape{17, config.fine_dim}));
}

}  // namespace
}  // namespace vsplat
