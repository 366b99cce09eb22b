// LaRa's network, every stage of it and every gradient, against the PyTorch specification's vectors; and the properties
// that hold of a run as a whole.
#include "model/networks/lara/lara_model.h"

#include <gtest/gtest.h>

#include <set>

#include "model/networks/lara/decoder.h"
#include "model/networks/params/params.h"
#include "model/ops/networks/decode.h"
#include "tests/support/compare.h"
#include "tests/support/lara_golden.h"
#include "tests/support/network_vectors.h"
#include "tests/support/refusal.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::drawings;
using test::expect_picture;
using test::LaraGolden;
using test::upload;

// The specification stores rows by view, [V, r^3, C + E]; the device stores them by voxel.
std::vector<float> lifted_by_view(const std::vector<float>& samples, const std::vector<float>& embedded,
                                  const LaraConfig& c, std::size_t views) {
  const auto voxels = static_cast<std::size_t>(c.lifted_voxels()), dim = static_cast<std::size_t>(c.vit_dim),
             e = static_cast<std::size_t>(c.view_ch);
  std::vector<float> out;
  for (std::size_t v = 0; v < views; ++v)
    for (std::size_t i = 0; i < voxels; ++i) {
      const auto row = static_cast<long>(i * views + v), d = static_cast<long>(dim), w = static_cast<long>(e);
      out.insert(out.end(), samples.begin() + row * d, samples.begin() + (row + 1) * d);
      out.insert(out.end(), embedded.begin() + row * w, embedded.begin() + (row + 1) * w);
    }
  return out;
}

// A run of the model on a golden file's inputs, with every stage's output recorded and the renderings fixed.
struct ModelRun {
  test::StageOutputs stages;
  LaraResult result;

  ModelRun(Context& ctx, const LaraGolden& golden) {
    const LaraModel model(ctx, golden.config(), golden.weights());
    const ViewDrawings held = drawings(ctx, golden);
    LaraOptions options;
    options.held = &held;
    options.tap = stages.tap(ctx);
    result = model.forward(ctx, upload(ctx, golden, "input.images"), golden.cameras(), options);
    auto& values = stages.values;
    values["lifted"] = lifted_by_view(values.at("lifted.samples"), values.at("lifted.embedded"), golden.config(),
                                      golden.cameras().size());
    stages.channels["lifted"] = static_cast<std::size_t>(golden.config().lifted_ch());
    values.erase("lifted.samples");
    values.erase("lifted.embedded");
  }
};

class LaraVectors : public test::VectorsTest {};

VSPLAT_VECTORS(LaraVectors, test::joined({"lara_micro"}, test::lara_cases()));
VSPLAT_SLOW_VECTORS(LaraVectors, test::slow_lara_cases());

TEST_P(LaraVectors, EveryStageMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const LaraGolden golden = LaraGolden::load(name());
  const ModelRun run(ctx(), golden);
  EXPECT_EQ(run.result.kept, golden.kept());
  for (const auto& [stage, values] : run.stages.values) {
    ASSERT_TRUE(golden.has("stage." + stage)) << stage;
    EXPECT_TRUE(test::close_by_channel(values, golden.floats("stage." + stage), run.stages.channels.at(stage), 1e-4))
        << stage;
  }
  // features, lifted, volume, samples and output of the fine decoder, two times five fields; three of each layer.
  EXPECT_EQ(run.stages.values.size(), 15 + 3 * static_cast<std::size_t>(golden.config().layers));
  const auto features = static_cast<std::size_t>(golden.config().fine_features);
  if (features == 0) {
    EXPECT_FALSE(run.result.features);
    return;
  }
  const auto output = golden.floats("stage.fine.output");
  const std::size_t width = features + 3 * static_cast<std::size_t>(golden.config().sh_count());
  std::vector<float> want;
  for (std::size_t i = 0; i < output.size(); ++i)
    if (i % width < features) want.push_back(output[i]);
  EXPECT_TRUE(test::close(ctx().read<float>(run.result.features), want, 1e-4));
}

// Without given drawings: the product's own renderer draws the coarse primitives, surfels and Gaussians.
TEST_P(LaraVectors, DrawsItsCoarsePrimitives) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const LaraGolden golden = LaraGolden::load(name());
  const DrawView draw = draw_view(golden.config());
  std::vector<float> colour, alpha, depth;
  LaraOptions options;
  options.draw = [&](Context& on, const DeviceGaussians& gaussians, const Camera& camera) {
    const ViewDrawings drawn = draw(on, gaussians, camera);
    if (on.planning()) return drawn;
    for (const auto& [to, from] : {std::pair{&colour, drawn.colour}, {&alpha, drawn.alpha}, {&depth, drawn.depth}}) {
      const auto values = on.read<float>(from);
      to->insert(to->end(), values.begin(), values.end());
    }
    return drawn;
  };
  const LaraModel model(ctx(), golden.config(), golden.weights());
  const LaraResult result = model.forward(ctx(), upload(ctx(), golden, "input.images"), golden.cameras(), options);
  for (float& x : colour) x = std::clamp(x, 0.0f, 1.0f);
  expect_picture(colour, golden.floats("stage.drawing.image"), "image");
  expect_picture(alpha, golden.floats("stage.drawing.alpha"), "alpha");
  if (golden.config().kind == "surfel")
    for (std::size_t i = 0; i < depth.size(); ++i) depth[i] = alpha[i] > 0 ? depth[i] / alpha[i] : 0;
  expect_picture(depth, golden.floats("stage.drawing.depth"), "depth");
  EXPECT_EQ(result.kept, golden.kept());
  expect_picture(ctx().read<float>(result.final.sh), golden.floats("stage.final.sh"), "final.sh");
}

GaussianGradients zeros_like(Context& ctx, const DeviceGaussians& g) {
  return zero_gradients(ctx, g.count(), g.sh_degree(), g.kind());
}

// Both halves, in training.
LaraModel::Trained forward(Context& ctx, const LaraModel& model, const LaraGolden& golden, const LaraOptions& options,
                           bool recompute) {
  const Tensor images = upload(ctx, golden, "input.images");
  return model.fine_in_training(ctx, model.coarse_in_training(ctx, images, golden.cameras(), options, recompute),
                                options);
}

// The gradients by all weights for cotangents on one level alone: "coarse"; "fixed", for the final level with constant
// drawings; "final", through the drawings.
std::map<std::string, std::vector<float>> gradients(Context& ctx, const LaraGolden& golden, const std::string& which,
                                                    bool recompute) {
  const LearntWeights learnt(ctx, parameters(golden.config()), golden.weights());
  const LaraModel model(ctx, golden.config(), learnt);
  const ViewDrawings held = drawings(ctx, golden);
  LaraOptions options;
  if (which != "final") options.held = &held;
  LaraModel::Trained trained = forward(ctx, model, golden, options, recompute);
  if (which == "coarse")
    model.backward(ctx, trained, test::cotangents(ctx, golden, "coarse"), {});
  else
    model.backward(ctx, trained, zeros_like(ctx, trained.result.coarse), test::cotangents(ctx, golden, "final"));
  std::map<std::string, std::vector<float>> out;
  for (const std::string& name : learnt.names()) out[name] = ctx.read<float>(learnt.at(name).gradient);
  return out;
}

TEST_P(LaraVectors, EveryGradientMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const LaraGolden golden = LaraGolden::load(name());
  for (const std::string which : {"coarse", "fixed", "final"}) {
    const std::string prefix = "cograd." + which + ".";
    const int compared = test::expect_gradients(golden, prefix, gradients(ctx(), golden, which, false));
    // Without a gradient from the coarse primitives, only the fine decoder has one.
    const int all = static_cast<int>(parameters(golden.config()).size());
    EXPECT_EQ(compared, which == "coarse" ? all - 10 : all) << prefix;
  }
}

class Lara : public test::FlavourTest {};
VSPLAT_FLAVOURS(Lara);

TEST_P(Lara, RunningOnceMoreGivesTheSameGradients) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const auto kept = gradients(ctx(), golden, "final", false);
  EXPECT_EQ(gradients(ctx(), golden, "final", true), kept);
  EXPECT_EQ(gradients(ctx(), golden, "final", false), kept);
}

TEST_P(Lara, TwoRunsGiveTheSameBits) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  EXPECT_EQ(ModelRun(ctx(), golden).stages.values, ModelRun(ctx(), golden).stages.values);
}

// The fine decoder processes primitives in blocks: the block size does not affect the result, forward or backward, not
// even if a voxel's two primitives are in two blocks.
TEST_P(Lara, FineDecoderInBlocks) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const LearntWeights learnt(ctx(), parameters(golden.config()), golden.weights());
  const LaraFineDecoder decoder(ctx(), golden.config(), learnt);
  const ViewDrawings held = drawings(ctx(), golden);
  LaraFineDecoder::Input in;
  in.volume = upload(ctx(), golden, "stage.volume");
  in.means = upload(ctx(), golden, "stage.final.means");
  in.kept = golden.kept();
  in.cameras = upload_cameras(ctx(), golden.cameras());
  const Tensor images = upload(ctx(), golden, "input.images");
  in.maps = ctx().tensor({images.dim(0), images.dim(1), images.dim(2), kViewMap});
  view_maps_forward(ctx(), {images, held, 0, false, in.maps});
  const Tensor dout = upload(ctx(), golden, "stage.fine.output");  // any numbers will do

  struct Results {
    std::vector<float> output, volume, means, maps, weight;
  };
  const auto run = [&](long block) {
    in.block = block;
    learnt.zero_gradients(ctx());
    Results r;
    r.output = ctx().read<float>(decoder.forward(ctx(), in));
    const LaraFineDecoder::Gradients d{ctx().tensor(in.volume.shape()),
                                       ctx().tensor(upload(ctx(), golden, "stage.coarse.means").shape()),
                                       ctx().tensor(in.maps.shape())};
    for (const Tensor& t : {d.volume, d.means, d.maps}) ctx().fill_zero(t);
    decoder.backward(ctx(), in, dout, d);
    r.volume = ctx().read<float>(d.volume), r.means = ctx().read<float>(d.means), r.maps = ctx().read<float>(d.maps);
    r.weight = ctx().read<float>(learnt.at("decoder.cross_att.k_proj_weight").gradient);
    return r;
  };
  const Results whole = run(16384);
  for (const long block : {1L, 7L, 60L}) {
    const Results parts = run(block);
    EXPECT_TRUE(test::close(parts.output, whole.output, 1e-6)) << block;
    EXPECT_TRUE(test::close(parts.volume, whole.volume, 1e-5)) << block;
    EXPECT_TRUE(test::close(parts.means, whole.means, 1e-5)) << block;
    EXPECT_TRUE(test::close(parts.maps, whole.maps, 1e-5)) << block;
    EXPECT_TRUE(test::close(parts.weight, whole.weight, 1e-5)) << block;
  }
}

// If nothing is opaque enough, the result is empty, and there is no error.
TEST_P(Lara, NothingKept) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  LaraConfig config = golden.config();
  config.opacity_threshold = 0.9999999;
  const LearntWeights learnt(ctx(), parameters(config), golden.weights());
  const LaraModel model(ctx(), config, learnt);
  const ViewDrawings held = drawings(ctx(), golden);
  LaraOptions options;
  options.held = &held;
  const Tensor images = upload(ctx(), golden, "input.images");
  EXPECT_EQ(model.forward(ctx(), images, golden.cameras(), options).final.count(), 0);
  LaraModel::Trained trained = forward(ctx(), model, golden, options, false);
  model.backward(ctx(), trained, test::cotangents(ctx(), golden, "coarse"), zeros_like(ctx(), trained.result.final));
  const auto got = ctx().read<float>(learnt.at("decoder.mlp_fine.0.weight").gradient);
  EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f));
}

TEST_P(Lara, MoreViewsThanItHasEmbeddingsForAreRefused) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const LaraModel model(ctx(), golden.config(), golden.weights());
  const std::vector<Camera> four(4, golden.cameras()[0]);
  test::expect_error(Status::usage, {"view_slots = 3"}, [&] {
    model.forward(ctx(), ctx().tensor({4, 12, 12, 3}), four, {});
  });
}

TEST_P(Lara, PlanTellsTheMemoryOfTheRun) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const LaraConfig& config = golden.config();
  const auto views = static_cast<long>(golden.cameras().size()), kept = static_cast<long>(golden.kept().size());
  const auto plan_ctx = test::open_context(GetParam());
  const MemoryPlan plan = LaraModel::plan(*plan_ctx, config, golden.weights(), views, kept);
  EXPECT_EQ(plan.selected, kept);
  EXPECT_EQ(plan_ctx->memory().reserved(), 0U) << "a plan allocates nothing";
  EXPECT_GT(plan.peak, plan.weights);
  std::set<std::string> stages;
  for (const StageMemory& stage : plan.stages) stages.insert(stage.stage);
  EXPECT_EQ(stages, (std::set<std::string>{"encoder", "modulation", "lifting", "volume", "heads", "decode", "selection",
                                           "splat", "project", "sort", "refinement"}));

  test::expect_refused_when_tight(GetParam(), plan, [&](Context& small) {
    const LaraModel model(small, config, golden.weights());
    const ViewDrawings held = drawings(small, golden);
    LaraOptions options;
    options.held = &held;
    model.forward(small, upload(small, golden, "input.images"), golden.cameras(), options);
  });
}

}  // namespace
}  // namespace vsplat
