// Gradients in mixed precision against PyTorch's, within the error that bf16 operands may cause; runs give the same
// bits.
#include <gtest/gtest.h>

#include <cmath>

#include "model/networks/params/params.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/mixed.h"
#include "tests/support/network_vectors.h"

namespace vsplat {
namespace {

using test::Golden;

class MixedGradients : public test::MixedTest {};

// The selection is the reference's, because a threshold's is not continuous.
TEST_P(MixedGradients, OfTheNetworkAreWithinTheirBound) {
  VSPLAT_NEED_GOLDEN(name());
  const Golden golden = Golden::load(name());
  const Config& config = golden.config();
  const auto ctx = open();
  const LearntWeights weights(*ctx, config, golden.weights());
  const VsplatModel model(*ctx, config, weights);
  const long edge = config.image, views = golden.views();
  std::vector<float> pictures = golden.floats("input.images");
  pictures.resize(static_cast<std::size_t>(views * edge * edge * 3));
  const Tensor images = ctx->upload({views, edge, edge, 3}, pictures);
  const std::vector<int> selection = test::golden_index(golden);
  const auto run = [&](bool recompute) {
    weights.zero_gradients(*ctx);
    ForwardOptions options;
    options.temperature = golden.temperature();
    options.selection = &selection;
    const DeviceCameras cameras = upload_cameras(*ctx, test::golden_cameras(golden));
    VsplatModel::Trained trained =
        model.fine_in_training(*ctx, model.coarse_in_training(*ctx, images, cameras, options, recompute), options);
    model.backward(*ctx, trained, test::cotangents(*ctx, golden, "coarse"), test::cotangents(*ctx, golden, "final"), {},
                   {});
    std::map<std::string, std::vector<float>> gradients;
    for (const Parameter& p : parameters(config))
      if (p.trained) gradients[p.name] = ctx->read<float>(weights.at(p.name).gradient);
    return gradients;
  };
  const auto got = run(false);
  double error = 0, norm = 0;
  for (const auto& [parameter, values] : got) {
    const std::vector<float> want =
        golden.has("cograd." + parameter) ? golden.floats("cograd." + parameter) : std::vector<float>(values.size());
    for (std::size_t i = 0; i < values.size(); ++i) {
      ASSERT_TRUE(std::isfinite(values[i])) << parameter;
      error += std::pow(static_cast<double>(values[i]) - want[i], 2);
      norm += std::pow(static_cast<double>(want[i]), 2);
    }
  }
  // About twice the errors measured. The cpu kernels also round by Winograd's method, with as few as 32 channels.
  EXPECT_LE(std::sqrt(error / norm), flavour() == Flavour::cpu ? 5e-2 : 2e-2);
  EXPECT_GT(std::sqrt(error / norm), 1e-4) << "nothing was rounded";
  EXPECT_EQ(run(false), got);
  EXPECT_EQ(run(true), got) << "recomputed";
}

INSTANTIATE_TEST_SUITE_P(Units, MixedGradients,
                         ::testing::Combine(::testing::Values("micro", "train"), test::kMixedUnits), test::mixed_name);

}  // namespace
}  // namespace vsplat
