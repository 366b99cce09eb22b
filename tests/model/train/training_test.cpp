// Gradients of all parameters, and steps of the optimiser, against PyTorch's.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "model/base/scene.h"
#include "model/diagnose/selftest/reference/adamw.h"
#include "model/diagnose/selftest/reference/muon.h"
#include "model/networks/params/params.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/render/render_backward.h"
#include "model/train/trainer.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/network_vectors.h"
#include "tests/support/training_views.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::Golden;

TrainingViews views_of(const Golden& golden) {
  TrainingViews out;
  out.object = "golden";
  out.pictures = golden.floats("input.images");
  out.cameras = test::golden_all_cameras(golden);
  out.inputs = golden.views();
  const std::vector<float> background = golden.floats("input.background");
  for (std::size_t c = 0; c < 3; ++c) out.background[c] = background[c];
  return out;
}

PassViews upload(Context& ctx, const Golden& golden) {
  PassViews out = test::upload_views_of_step(ctx, views_of(golden), golden.config().image);
  if (golden.has("input.c2w_given")) out.given = test::golden_cameras(golden);
  return out;
}

ForwardOptions options_of(Context& ctx, const Golden& golden) {
  ForwardOptions out;
  out.temperature = golden.temperature();
  if (golden.has("input.noise")) out.noise = ctx.upload({golden.config().voxels()}, golden.floats("input.noise"));
  return out;
}

bool all_zero(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return v == 0; });
}

class GoldenGradients : public test::VectorsTest {};

// The network alone, for given gradients with respect to its Gaussians.
TEST_P(GoldenGradients, OfTheNetworkMatch) {
  const auto& [flavour, name] = GetParam();
  VSPLAT_NEED_GOLDEN(name);
  const Golden golden = Golden::load(name);
  Context& ctx = test::context(flavour);
  const LearntWeights weights(ctx, golden.config(), golden.weights());
  const VsplatModel model(ctx, golden.config(), weights);
  const PassViews views = upload(ctx, golden);
  const auto run = [&](bool recompute) {
    weights.zero_gradients(ctx);
    const ForwardOptions options = options_of(ctx, golden);
    const DeviceCameras cameras = upload_cameras(ctx, test::golden_cameras(golden));
    VsplatModel::Trained trained =
        model.fine_in_training(ctx, model.coarse_in_training(ctx, views.inputs, cameras, options, recompute), options);
    const bool one_level = golden.config().levels == "coarse";
    model.backward(ctx, trained, test::cotangents(ctx, golden, "coarse"),
                   one_level ? GaussianGradients() : test::cotangents(ctx, golden, "final"), {},
                   trained.rays ? test::golden_upload(ctx, golden, "cotangent.plucker") : Tensor());
  };
  run(false);
  int compared = 0;
  std::map<std::string, std::vector<float>> first;
  for (const Parameter& p : parameters(golden.config())) {
    if (!p.trained) continue;
    const std::vector<float> got = first[p.name] = ctx.read<float>(weights.at(p.name).gradient);
    if (!golden.has("cograd." + p.name)) {
      EXPECT_TRUE(all_zero(got)) << p.name << " has a gradient, in the reference it has none";
      continue;
    }
    const std::vector<float> want = golden.floats("cograd." + p.name);
    if (all_zero(want)) {
      EXPECT_TRUE(all_zero(got)) << p.name;
    } else {
      EXPECT_TRUE(test::close(got, want, 1e-4)) << p.name;
    }
    ++compared;
  }
  EXPECT_GT(compared, 30);
  for (const bool recompute : {false, true}) {
    run(recompute);
    for (const auto& [parameter, values] : first)
      EXPECT_EQ(ctx.read<float>(weights.at(parameter).gradient), values)
          << parameter << (recompute ? ", recomputed" : ", run again");
  }
}

// Gradients of the loss through the rasteriser of both levels. All are compared together, because a flipped pixel
// changes single ones.
TEST_P(GoldenGradients, OfTheLossMatch) {
  const auto& [flavour, name] = GetParam();
  VSPLAT_NEED_GOLDEN(name);
  const Golden golden = Golden::load(name);
  ASSERT_TRUE(golden.has("loss"));
  Context& ctx = test::context(flavour);
  const LearntWeights weights(ctx, golden.config(), golden.weights());
  const auto network = make_network(ctx, golden.config(), weights);
  PassOptions options;
  options.forward = options_of(ctx, golden);
  const PassResult result = training_pass(ctx, *network, upload(ctx, golden), options);
  double loss = 0;
  for (const LevelLoss& level : {result.coarse, result.final})
    for (const Tensor& view : level)
      loss += static_cast<double>(ctx.read<float>(view)[0]) / static_cast<double>(level.size());
  EXPECT_EQ(golden.has("loss.ray"), static_cast<bool>(result.rays));
  if (result.rays) {
    EXPECT_NEAR(ctx.read<float>(result.rays)[0], golden.floats("loss.ray")[0], 1e-5);
    loss += golden.config().share_loss_weight * static_cast<double>(ctx.read<float>(result.rays)[0]);
  }
  EXPECT_NEAR(loss, golden.floats("loss")[0], 1e-4);

  double error = 0, norm = 0;
  for (const Parameter& p : parameters(golden.config())) {
    if (!p.trained) continue;
    const std::vector<float> got = ctx.read<float>(weights.at(p.name).gradient);
    const std::vector<float> want =
        golden.has("grad." + p.name) ? golden.floats("grad." + p.name) : std::vector<float>(got.size());
    EXPECT_TRUE(!all_zero(want) || all_zero(got)) << p.name;
    for (std::size_t i = 0; i < got.size(); ++i) {
      ASSERT_TRUE(std::isfinite(got[i])) << p.name;
      error += std::pow(static_cast<double>(got[i]) - want[i], 2);
      norm += std::pow(static_cast<double>(want[i]), 2);
    }
  }
  // If nothing is selected and no gradient reaches the confidence, there is none at all.
  if (norm == 0)
    EXPECT_EQ(error, 0);
  else
    EXPECT_LE(std::sqrt(error / norm), 1e-2);
}

const auto kFlavours = ::testing::Values(Flavour::cpu, Flavour::gpu);
const auto kQuick = ::testing::ValuesIn(test::quick_training_cases());
const auto kSlow = ::testing::ValuesIn(test::slow_training_cases());
INSTANTIATE_TEST_SUITE_P(Made, GoldenGradients, ::testing::Combine(::testing::Values(Flavour::cpu), kQuick),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(SlowCases, GoldenGradients, ::testing::Combine(kFlavours, kSlow), test::vectors_name);
// Takes three times as long on a CPU, so only some cases are quick.
INSTANTIATE_TEST_SUITE_P(Slow, GoldenGradients, ::testing::Combine(::testing::Values(Flavour::gpu), kQuick),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(Some, GoldenGradients,
                         ::testing::Combine(::testing::Values(Flavour::gpu),
                                            ::testing::Values("train", "train_empty_ste", "train_mirrored")),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(Committed, GoldenGradients,
                         ::testing::Combine(kFlavours, ::testing::Values("micro", "micro_noise")), test::vectors_name);

INSTANTIATE_TEST_SUITE_P(Extensions, GoldenGradients,
                         ::testing::Combine(kFlavours, ::testing::ValuesIn(test::extension_cases())),
                         test::vectors_name);

INSTANTIATE_TEST_SUITE_P(SlowExtensions, GoldenGradients,
                         ::testing::Combine(kFlavours, ::testing::ValuesIn(test::slow_extension_cases())),
                         test::vectors_name);

class Training : public test::FlavourTest {};
VSPLAT_FLAVOURS(Training);

// The alpha loss adds, to the gradients by the Gaussians, those of alpha_weight times the mean over views and pixels of
// |alpha - given|, computed here from what was drawn; views without a mask add nothing.
TEST_P(Training, TheAlphasLossComesOnTop) {
  const Golden golden = Golden::load("micro");
  const Config& config = golden.config();
  const LearntWeights weights(ctx(), config, golden.weights());
  const auto network = make_network(ctx(), config, weights);
  const long s = config.image;
  PassViews views = upload(ctx(), golden);
  std::vector<std::vector<std::uint8_t>> rgba(views.cameras.size());
  for (std::size_t v = 1; v < rgba.size(); ++v)  // the first has no mask
    for (long i = 0; i < s * s; ++i)
      for (int c = 0; c < 4; ++c)
        rgba[v].push_back(static_cast<std::uint8_t>((97 * i + 31 * static_cast<long>(v)) % 256));
  for (const auto& one : rgba) views.rgba.push_back(one.empty() ? Tensor() : ctx().upload({s, s, 4}, one, Type::u8));
  PassOptions options;
  options.forward = options_of(ctx(), golden);
  options.scale = 0.5f;
  const auto drawn = [&](float alpha_weight) {
    weights.zero_gradients(ctx());
    options.alpha_weight = alpha_weight;
    return draw_pass(ctx(), *network, views, options, begin_pass(ctx(), *network, views, options));
  };
  const DrawnPass without = drawn(0), with = drawn(3);
  const GaussianChunks scene(with.trained.coarse);
  const SceneGradient want = zero_gradient(ctx(), scene);
  for (std::size_t v = 1; v < views.cameras.size(); ++v) {
    RenderOptions how;
    how.near = static_cast<float>(kNearInObject);
    how.background = views.backgrounds[v];
    if (config.negate_camera_centre) how.mirror = std::array<float, 3>{0, 0, 0};
    const DrawnPicture picture = render_with_backward(
        ctx(), scene, views.cameras[v], how, [](Context&, const DevicePicture&) { return PictureGradient{}; },
        zero_gradient(ctx(), scene));
    std::vector<float> slope = ctx().read<float>(picture.picture.alpha);
    for (std::size_t i = 0; i < slope.size(); ++i) {
      const double off = static_cast<double>(slope[i]) - rgba[v][4 * i + 3] / 255.0;
      const double size = 3 * 0.5 / static_cast<double>(views.cameras.size()) / static_cast<double>(s * s);
      slope[i] = static_cast<float>(std::abs(off) > 0.5 / 255 ? std::copysign(size, off) : 0);
    }
    render_backward(ctx(), scene, views.cameras[v], how, {{}, ctx().upload({s, s}, slope), {}}, want, nullptr);
  }
  for (const auto part : {&GaussianGradients::opacities, &GaussianGradients::means, &GaussianGradients::scales}) {
    const std::vector<float> a = ctx().read<float>(without.dcoarse.*part), b = ctx().read<float>(with.dcoarse.*part);
    const std::vector<float> expected = ctx().read<float>(want.front().*part);
    std::vector<float> difference(a.size());
    for (std::size_t i = 0; i < a.size(); ++i) difference[i] = b[i] - a[i];
    EXPECT_FALSE(all_zero(expected));
    EXPECT_TRUE(test::close(difference, expected, 1e-4));
  }
  EXPECT_EQ(ctx().read<float>(without.result.coarse[1]), ctx().read<float>(with.result.coarse[1]))
      << "what is reported";
}

// The sparsity loss adds its gradient by the opacities of both levels, and by nothing else.
TEST_P(Training, TheSparsityLossComesOnTop) {
  const Golden golden = Golden::load("micro");
  const LearntWeights weights(ctx(), golden.config(), golden.weights());
  const auto network = make_network(ctx(), golden.config(), weights);
  const PassViews views = upload(ctx(), golden);
  PassOptions options;
  options.forward = options_of(ctx(), golden);
  options.scale = 0.5f;
  const auto drawn = [&](float weight) {
    weights.zero_gradients(ctx());
    options.sparsity_weight = weight;
    return draw_pass(ctx(), *network, views, options, begin_pass(ctx(), *network, views, options));
  };
  const DrawnPass without = drawn(0), with = drawn(3);
  const auto check = [&](const Tensor& opacities, const GaussianGradients& before, const GaussianGradients& after) {
    const std::vector<float> o = ctx().read<float>(opacities), a = ctx().read<float>(before.opacities),
                             b = ctx().read<float>(after.opacities);
    std::vector<float> difference, expected;
    for (std::size_t i = 0; i < o.size(); ++i)
      difference.push_back(b[i] - a[i]), expected.push_back(3 * 0.5f / (0.05f + o[i]) / static_cast<float>(o.size()));
    EXPECT_TRUE(test::close(difference, expected, 1e-4));
    EXPECT_EQ(ctx().read<float>(before.sh), ctx().read<float>(after.sh));
    EXPECT_EQ(ctx().read<float>(before.means), ctx().read<float>(after.means));
  };
  check(with.trained.coarse.opacities, without.dcoarse, with.dcoarse);
  check(with.trained.final.opacities, without.dfinal, with.dfinal);
  EXPECT_EQ(ctx().read<float>(without.result.final[0]), ctx().read<float>(with.result.final[0])) << "what is reported";
}

// Ten steps of AdamW with clipping, warm-up and annealing, with PyTorch's noise.
TEST_P(Training, TenStepsGiveTheLossesOfPyTorch) {
  VSPLAT_NEED_GOLDEN("train_steps");
  const Golden golden = Golden::load("train_steps");
  const std::vector<float> want = golden.floats("step.loss"), noise = golden.floats("step.noise");
  ASSERT_EQ(want.size(), 10U);
  Checkpoint start;
  start.config.model = golden.config();
  start.config.schedule = {4e-4, 2, 10, 1.0, 0.1, 9};
  start.parameters = golden.weights();
  Trainer trainer(ctx(), start, golden.config().voxels() / 4);
  const TrainingViews views = views_of(golden);
  const auto voxels = static_cast<std::ptrdiff_t>(golden.config().voxels());
  for (std::size_t s = 0; s < want.size(); ++s) {
    const auto from = noise.begin() + static_cast<std::ptrdiff_t>(s) * voxels;
    const std::vector<float> of_step(from, from + voxels);
    const StepReport report = trainer.step({{&views, views.background, &of_step}});
    EXPECT_NEAR(report.loss, want[s], 1e-4) << "step " << s + 1;
    EXPECT_EQ(report.step, static_cast<long>(s) + 1);
  }
  EXPECT_LT(want.back(), want.front() - 1e-3f) << "the reference learns nothing: nothing is tested";
}

// In a step each parameter moves as its optimiser would move it by the step's gradient: matrices by Muon, all others by
// AdamW. A checkpoint stores enough of both to continue with the same bits.
TEST_P(Training, MuonMovesMatricesAndNothingElse) {
  const Golden golden = Golden::load("micro");
  const TrainingViews views = views_of(golden);
  Checkpoint start;
  start.config.model = golden.config();
  start.config.schedule = {0.01, 0, 10, 1.0, 0.1, 9};
  start.config.optimizer = "muon";
  start.parameters = golden.weights();
  Trainer trainer(ctx(), start);
  const StepReport report = trainer.step({{&views, views.background}});
  const double factor = ref::clip_factor(report.gradient_norm, start.config.clip_norm);
  const Checkpoint after = trainer.checkpoint();
  long matrices = 0, others = 0;
  for (const Parameter& p : parameters(start.config.model)) {
    if (!p.trained || !p.used) continue;
    const auto doubles = [](const std::vector<float>& x) { return std::vector<double>(x.begin(), x.end()); };
    std::vector<double> want = doubles(start.parameters.of(p).data);
    std::vector<double> gradient = doubles(ctx().read<float>(trainer.weights().at(p.name).gradient));
    for (double& g : gradient) g *= factor;
    const double decay = p.decays ? start.config.weight_decay : 0;
    const bool matrix = p.shape.size() >= 2 && p.name.ends_with(".weight") && !p.name.starts_with("predictor.");
    ++(matrix ? matrices : others);
    EXPECT_EQ(after.momentum.has(p.name), matrix) << p.name;
    EXPECT_EQ(after.m.has(p.name), !matrix) << p.name;
    if (matrix) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const long columns = p.count() / p.shape[0];
      Eigen::MatrixXd param = Eigen::Map<RowMajor>(want.data(), p.shape[0], columns), m = 0 * param;
      ref::muon({report.lr, start.config.momentum, decay}, Eigen::Map<RowMajor>(gradient.data(), p.shape[0], columns),
                param, m);
      Eigen::Map<RowMajor>(want.data(), p.shape[0], columns) = param;
    } else {
      std::vector<double> m(want.size()), v(want.size());
      ref::adamw({report.lr, 0.9, 0.95, 1e-8, decay}, 1, gradient, want, m, v);
    }
    EXPECT_TRUE(test::close(after.parameters.of(p).data, want, 1e-5)) << p.name;
  }
  EXPECT_GT(matrices, 20);
  EXPECT_GT(others, 20);

  Trainer resumed(ctx(), after);
  for (Trainer* each : {&trainer, &resumed}) each->step({{&views, views.background}});
  const Checkpoint one = trainer.checkpoint(), other = resumed.checkpoint();
  for (const Parameter& p : parameters(start.config.model))
    EXPECT_EQ(one.parameters.of(p).data, other.parameters.of(p).data) << p.name;
}

}  // namespace
}  // namespace vsplat
