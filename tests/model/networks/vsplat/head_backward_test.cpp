// The heads' and the selection's backward: against differences in double, and against PyTorch's gradients by weights.
#include <functional>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/networks/params/init.h"
#include "model/networks/vsplat/head.h"
#include "model/networks/vsplat/voxel_selection.h"
#include "model/ops/dense/gather.h"
#include "tests/reference/heads.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

using test::close;
using test::close_by_channel;

// Random values for n Gaussians: coefficients of a loss that is linear in them, or Gaussians.
ref::GaussianLists random_lists(std::size_t n, std::size_t s, std::uint32_t seed) {
  return {test::random_doubles(3 * n, seed), test::random_doubles(3 * n, seed + 1),
          test::random_doubles(4 * n, seed + 2), test::random_doubles(n, seed + 3, 0.1f, 1),
          test::random_doubles(3 * s * n, seed + 4)};
}

double dot(const ref::GaussianLists& a, const ref::GaussianLists& b) {
  return ref::weighed(a.means, b.means) + ref::weighed(a.scales, b.scales) + ref::weighed(a.quats, b.quats) +
         ref::weighed(a.opacities, b.opacities) + ref::weighed(a.sh, b.sh);
}

// By central differences; the loss reads x.
std::vector<double> head_differences(std::vector<double>& x, const std::function<double()>& loss) {
  return ref::central_differences(x, 1e-5, loss);
}

class HeadBackward : public test::FlavourTest {
 protected:
  HeadBackward() : config_(named_config("micro")), weights_(initial_weights(config_, 7)) {
    for (const auto& [name, t] : std::map<std::string, HostTensor>(weights_.all())) {
      HostTensor other = t;  // biases of the heads begin at zero
      const auto more = test::random_floats(t.data.size(), 17, -0.2f, 0.2f);
      for (std::size_t i = 0; i < more.size(); ++i) other.data[i] += more[i];
      weights_.set(name, other);
    }
  }

  Tensor upload(const Shape& shape, const std::vector<double>& x) {
    return ctx().upload(shape, std::vector<float>(x.begin(), x.end()));
  }
  template <class Tensors>  // DeviceGaussians or GaussianGradients
  Tensors upload(const ref::GaussianLists& g) {
    const long n = static_cast<long>(g.opacities.size());
    return {upload({n, 3}, g.means), upload({n, 3}, g.scales), upload({n, 4}, g.quats), upload({n}, g.opacities),
            upload({n, config_.sh_count(), 3}, g.sh)};
  }
  GaussianGradients cotangents(const test::Golden& golden, const std::string& level) {
    const auto field = [&](const char* name) { return test::golden_upload(ctx(), golden, level + "." + name); };
    return {field("means"), field("scales"), field("quats"), field("opacities"), field("sh")};
  }
  // Compares the gradients by the weights with this prefix with PyTorch's, or with zeros if it has none.
  void expect_gradients(const test::Golden& golden, const LearntWeights& learnt, const std::string& prefix) {
    for (const std::string& name : learnt.names()) {
      if (!name.starts_with(prefix)) continue;
      const std::vector<float> got = ctx().read<float>(learnt.at(name).gradient);
      if (golden.has("cograd." + name)) {
        EXPECT_TRUE(close(got, golden.floats("cograd." + name), 2e-5)) << name;
      } else {
        EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f)) << name;
      }
    }
  }

  Config config_;
  Weights weights_;
};
VSPLAT_FLAVOURS(HeadBackward);

TEST_P(HeadBackward, OfCoarseHeadsAgreesWithDifferences) {
  const auto voxels = static_cast<std::size_t>(config_.voxels()), s = static_cast<std::size_t>(config_.sh_count());
  const auto channels = static_cast<std::size_t>(config_.volume_ch);
  std::vector<double> volume = test::random_doubles(voxels * channels, 1);
  const std::vector<double> dlogits = test::random_doubles(voxels, 2);
  const ref::GaussianLists d = random_lists(voxels, s, 3);
  const auto by_volume = [&](bool with_logits) {
    return head_differences(volume, [&] {
      const ref::CoarseHeads out = ref::coarse_heads(config_, weights_, volume);
      return (with_logits ? ref::weighed(out.logits, dlogits) : 0.0) + dot(out.gaussians, d);
    });
  };
  const LearntWeights learnt(ctx(), config_, weights_);
  const CoarseHeads heads(ctx(), config_, learnt);
  CoarseHeads::Saved saved;
  const Shape shape{config_.voxels(), config_.volume_ch};
  heads.forward(ctx(), upload(shape, volume), &saved);
  const Tensor dvolume = ctx().upload(shape, test::nans(volume.size()));
  const auto dgaussians = upload<GaussianGradients>(d);
  heads.backward(ctx(), saved, upload({config_.voxels()}, dlogits), dgaussians, dvolume, false);
  const std::vector<double> whole = by_volume(true);
  EXPECT_TRUE(close_by_channel(ctx().read<float>(dvolume), whole, channels, 1e-5));
  std::vector<double> sum = by_volume(false);
  for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += whole[i];
  const std::string name = "predictor.act_predictor.4.weight";
  const std::vector<float> before = ctx().read<float>(learnt.at(name).gradient);
  heads.backward(ctx(), saved, {}, dgaussians, dvolume, true);
  EXPECT_TRUE(close_by_channel(ctx().read<float>(dvolume), sum, channels, 1e-5)) << "without logits, added";
  EXPECT_EQ(ctx().read<float>(learnt.at(name).gradient), before);
}

TEST_P(HeadBackward, OfFineHeadsAgreesWithDifferences) {
  for (const std::size_t p : {1UL, 3UL, 17UL}) {
    SCOPED_TRACE(p);
    const auto s = static_cast<std::size_t>(config_.sh_count()), m = static_cast<std::size_t>(config_.fine_count);
    std::vector<double> refined = test::random_doubles(p * static_cast<std::size_t>(config_.fine_dim), 1);
    ref::GaussianLists skeleton = random_lists(p, s, 2), before = random_lists(p, s, 8);
    const ref::GaussianLists d = random_lists(p * m + p, s, 14);
    const auto loss = [&] { return dot(ref::fine_heads(config_, weights_, refined, skeleton), d); };

    const LearntWeights learnt(ctx(), config_, weights_);
    const FineHeads heads(ctx(), config_, learnt);
    FineHeads::Saved saved;
    const Shape shape{static_cast<long>(p), config_.fine_dim};
    heads.forward(ctx(), upload(shape, refined), upload<DeviceGaussians>(skeleton), &saved);
    const Tensor drefined = ctx().upload(shape, test::nans(refined.size()));
    auto dskeleton = upload<GaussianGradients>(before);
    dskeleton.sh = {};
    heads.backward(ctx(), saved, upload<GaussianGradients>(d), drefined, dskeleton);
    EXPECT_TRUE(close_by_channel(ctx().read<float>(drefined), head_differences(refined, loss),
                                 static_cast<std::size_t>(config_.fine_dim), 1e-5));
    const auto expect = [&](const Tensor& got, std::vector<double>& x, const std::vector<double>& added) {
      std::vector<double> want = head_differences(x, loss);
      for (std::size_t i = 0; i < want.size(); ++i) want[i] += added[i];
      EXPECT_TRUE(close(ctx().read<float>(got), want, 1e-5));
    };
    expect(dskeleton.means, skeleton.means, before.means);
    expect(dskeleton.scales, skeleton.scales, before.scales);
    expect(dskeleton.quats, skeleton.quats, before.quats);
    expect(dskeleton.opacities, skeleton.opacities, before.opacities);
  }
}

// Without selected voxels, nothing is computed and nothing is added.
TEST_P(HeadBackward, OfFineHeadsWithoutVoxels) {
  const LearntWeights learnt(ctx(), config_, weights_);
  const FineHeads heads(ctx(), config_, learnt);
  FineHeads::Saved saved;
  const DeviceGaussians none = upload<DeviceGaussians>({});
  EXPECT_EQ(heads.forward(ctx(), ctx().tensor({0, config_.fine_dim}), none, &saved).count(), 0);
  const GaussianGradients nothing = zero_gradients(ctx(), 0, 1);
  heads.backward(ctx(), saved, nothing, ctx().tensor({0, config_.fine_dim}), nothing);
  for (const std::string& name : learnt.names()) {
    const Tensor gradient = learnt.at(name).gradient;
    if (!gradient) continue;
    const std::vector<float> got = ctx().read<float>(gradient);
    EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f)) << name;
  }
}

// With levels "fine", only the final Gaussians depend on the fine heads' weights.
TEST_P(HeadBackward, OfFineHeadsMatchesTheSpecification) {
  for (const std::string& name : test::golden_present()) {
    const test::Golden golden = test::Golden::load(name);
    if (golden.config().levels != "fine" || !golden.has("cotangent.final.means")) continue;
    SCOPED_TRACE(name);
    const LearntWeights learnt(ctx(), golden.config(), golden.weights());
    const FineHeads heads(ctx(), golden.config(), learnt);
    const std::vector<int> index = test::golden_index(golden);
    const long p = static_cast<long>(index.size());
    const DeviceGaussians skeleton = gather_forward(ctx(), test::golden_gaussians(ctx(), golden, "stage.coarse"),
                                                    ctx().upload({p}, index, Type::i32, "index"));
    FineHeads::Saved saved;
    heads.forward(ctx(), test::golden_upload(ctx(), golden, "stage.refined"), skeleton, &saved);
    heads.backward(ctx(), saved, cotangents(golden, "cotangent.final"), ctx().tensor({p, golden.config().fine_dim}),
                   zero_gradients(ctx(), p, 1));
    expect_gradients(golden, learnt, "predictor.fine_predictor");
    expect_gradients(golden, learnt, "predictor.update_predictor");
  }
}

// With other levels, the coarse heads' weights affect the Gaussians only through selection and gathering.
TEST_P(HeadBackward, OfSelectionAndCoarseHeadsMatchesTheSpecification) {
  VSPLAT_NEED_GOLDEN("micro_skeletal");  // no committed case with gradients has other levels
  for (const std::string& name : test::golden_present()) {
    const test::Golden golden = test::Golden::load(name);
    const Config& config = golden.config();
    if (config.levels == "fine" || !golden.has("cotangent.coarse.means")) continue;
    SCOPED_TRACE(name);
    const LearntWeights learnt(ctx(), config, golden.weights());
    const CoarseHeads heads(ctx(), config, learnt);
    CoarseHeads::Saved saved;
    const Tensor volume = test::golden_upload(ctx(), golden, "stage.volume");
    const CoarseHeads::Output coarse = heads.forward(ctx(), volume, &saved);
    const GaussianGradients d = cotangents(golden, "cotangent.coarse");
    Tensor dlogits;
    if (config.levels == "skeletal") {
      SelectionOptions options;
      options.temperature = static_cast<float>(golden.temperature());
      if (golden.has("input.noise")) options.noise = test::golden_upload(ctx(), golden, "input.noise");
      SelectionSaved selection;
      const SelectedVoxels selected =
          select_voxels(ctx(), config, coarse.logits, coarse.gaussians.opacities, options, &selection);
      ASSERT_EQ(ctx().read<int>(selected.index), test::golden_index(golden));
      gather_backward(ctx(), cotangents(golden, "cotangent.final"), selected.index, d);
      dlogits = select_voxels_backward(ctx(), selection, d.opacities);
    }
    heads.backward(ctx(), saved, dlogits, d, ctx().tensor(volume.shape()), false);
    expect_gradients(golden, learnt, "predictor.act_predictor");
    expect_gradients(golden, learnt, "predictor.coarse_predictor");
  }
}

}  // namespace
}  // namespace vsplat
