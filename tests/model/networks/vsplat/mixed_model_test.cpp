// The network in mixed precision on emulated matrix units of either flavour, and by the processor's instructions if it
// has them, with every product rounded, however small. Every stage is
// compared with PyTorch's vectors, within the error that bf16 operands may cause; two runs give the same bits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "model/networks/vsplat/vsplat_model.h"
#include "tests/support/compare.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/mixed.h"

namespace vsplat {
namespace {

using test::Golden;

// Error of a stage: root mean square error divided by the root mean square of the expected values.
struct StageBound {
  const char* name;
  double
      most[2];  // of the gpu kernels and of the cpu kernels, which also round attention's products, and by Winograd's
                // method those of convolutions with as few as 32 channels
};

using MixedStages = std::map<std::string, std::vector<float>>;

// Uses the golden selection, because a threshold's selection is not continuous.
MixedStages run_mixed(Context& ctx, const Golden& golden) {
  const Config& config = golden.config();
  const VsplatModel model(ctx, config, golden.weights());
  const long edge = config.image, views = golden.views();
  std::vector<float> images = golden.floats("input.images");
  images.resize(static_cast<std::size_t>(views * edge * edge * 3));
  const std::vector<int> selection = test::golden_index(golden);
  MixedStages out;
  ForwardOptions options;
  options.temperature = golden.temperature();
  options.selection = &selection;
  options.tap = [&](const std::string& name, const Tensor& t) { out[name] = ctx.read<float>(t); };
  model.forward(ctx, ctx.upload({views, edge, edge, 3}, images), upload_cameras(ctx, test::golden_cameras(golden)),
                options);
  return out;
}

double off_by(const std::vector<float>& got, const std::vector<float>& want) {
  double error = 0, all = 0;
  for (std::size_t i = 0; i < want.size(); ++i)
    error += std::pow(static_cast<double>(got[i]) - want[i], 2), all += std::pow(static_cast<double>(want[i]), 2);
  return got.size() == want.size() ? std::sqrt(error / all) : INFINITY;
}

class MixedModel : public test::MixedTest {};

// About twice the errors measured with these vectors.
constexpr StageBound kBounds[] = {
    {"features", {8e-3, 8e-3}},           {"volume", {7e-3, 1.8e-2}},     {"logits", {1.1e-2, 1.8e-2}},
    {"confidence", {9e-3, 2.2e-2}},       {"coarse.means", {5e-5, 1e-4}}, {"coarse.scales", {1.2e-3, 2.5e-3}},
    {"coarse.quats", {1e-2, 1.5e-2}},     {"coarse.sh", {8e-3, 1.2e-2}},  {"coarse.opacities", {9e-3, 2.2e-2}},
    {"projected", {8e-3, 8e-3}},          {"refined", {1.2e-2, 1.2e-2}},  {"final.means", {7e-5, 1.2e-4}},
    {"final.scales", {1.8e-3, 2.2e-3}},   {"final.quats", {1e-2, 1e-2}},  {"final.sh", {1.3e-2, 1.2e-2}},
    {"final.opacities", {2.2e-3, 3.2e-3}}};

TEST_P(MixedModel, EveryStageIsWithinItsBound) {
  VSPLAT_NEED_GOLDEN(name());
  const Golden golden = Golden::load(name());
  const auto ctx = open();
  const MixedStages stages = run_mixed(*ctx, golden);
  double largest = 0;
  EXPECT_EQ(stages.size(), std::size(kBounds));
  for (const StageBound& bound : kBounds) {
    ASSERT_TRUE(stages.count(bound.name)) << bound.name;
    const double off = off_by(stages.at(bound.name), golden.floats(std::string("stage.") + bound.name));
    EXPECT_LE(off, bound.most[ctx->flavour() == Flavour::cpu]) << bound.name;
    largest = std::max(largest, off);
  }
  EXPECT_GT(largest, 1e-4) << "nothing was rounded";
}

TEST_P(MixedModel, ThreeRunsGiveTheSameBits) {
  VSPLAT_NEED_GOLDEN(name());
  const Golden golden = Golden::load(name());
  const auto ctx = open(), other = open();
  const MixedStages first = run_mixed(*ctx, golden);
  EXPECT_EQ(run_mixed(*ctx, golden), first);
  EXPECT_EQ(run_mixed(*other, golden), first);
}

INSTANTIATE_TEST_SUITE_P(Units, MixedModel,
                         ::testing::Combine(::testing::Values("micro", "tiny", "tiny_paper"), test::kMixedUnits),
                         test::mixed_name);

}  // namespace
}  // namespace vsplat
