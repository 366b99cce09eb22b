// Gradients in mixed precision against PyTorch's, within the error that bf16 operands may cause; runs give the same
// bits.
#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "model/networks/params/params.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/mixed.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using test::Golden;

class MixedGradients : public ::testing::TestWithParam<std::tuple<const char*, test::MixedUnit>> {
 protected:
  void SetUp() override {
    const std::string why = test::cannot_multiply(std::get<1>(GetParam()));
    if (!why.empty()) GTEST_SKIP() << why;
  }
  test::Variable every_product_{"VSPLAT_MATRIX_LEAST", "1"};
};

// The selection is the reference's, because a threshold's is not continuous.
TEST_P(MixedGradients, OfTheNetworkAreWithinTheirBound) {
  const auto& [name, unit] = GetParam();
  VSPLAT_NEED_GOLDEN(name);
  const Golden golden = Golden::load(name);
  const Config& config = golden.config();
  const auto ctx = test::open_mixed(unit);
  const LearntWeights weights(*ctx, config, golden.weights());
  const VsplatModel model(*ctx, config, weights);
  std::vector<float> pictures = golden.floats("input.images");
  pictures.resize(static_cast<std::size_t>(golden.views() * config.image * config.image * 3));
  const Tensor images = ctx->upload({golden.views(), config.image, config.image, 3}, pictures);
  const std::vector<int> selection = test::golden_index(golden);
  const auto by = [&](const std::string& level) {
    const auto part = [&](const char* of) {
      return test::golden_upload(*ctx, golden, "cotangent." + level + "." + of);
    };
    return GaussianGradients{part("means"), part("scales"), part("quats"), part("opacities"), part("sh")};
  };
  const auto run = [&](bool recompute) {
    weights.zero_gradients(*ctx);
    ForwardOptions options;
    options.temperature = golden.temperature();
    options.selection = &selection;
    const DeviceCameras cameras = upload_cameras(*ctx, test::golden_cameras(golden));
    VsplatModel::Trained trained =
        model.fine_in_training(*ctx, model.coarse_in_training(*ctx, images, cameras, options, recompute), options);
    model.backward(*ctx, trained, by("coarse"), by("final"), {}, {});
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
  EXPECT_LE(std::sqrt(error / norm), unit.flavour == Flavour::cpu ? 5e-2 : 2e-2);
  EXPECT_GT(std::sqrt(error / norm), 1e-4) << "nothing was rounded";
  EXPECT_EQ(run(false), got);
  EXPECT_EQ(run(true), got) << "recomputed";
}

INSTANTIATE_TEST_SUITE_P(Units, MixedGradients,
                         ::testing::Combine(::testing::Values("micro", "train"), test::kMixedUnits),
                         [](const auto& info) {
                           return std::string(std::get<0>(info.param)) + "_" + std::get<1>(info.param).name();
                         });

}  // namespace
}  // namespace vsplat
