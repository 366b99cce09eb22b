// LaRa's network, every stage of it and every gradient, against the PyTorch specification's vectors; and the properties
// that hold of a run as a whole.
#include "model/networks/lara/lara_model.h"

#include <gtest/gtest.h>

#include <set>

#include "model/networks/lara/decoder.h"
#include "model/networks/params/params.h"
#include "model/ops/networks/decode.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/lara_golden.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::LaraGolden;

const char* const kFields[] = {"means", "scales", "quats", "opacities", "sh"};

Tensor upload(Context& ctx, const LaraGolden& golden, const std::string& name) {
  const HostTensor t = golden.tensor(name);
  return ctx.upload(t.shape, t.data, Type::f32, name);
}

// Channels of a row: SH [N,S,3] are S colours, each coefficient with its own scale; a single number is its own row.
std::size_t channels_of(const Shape& shape) {
  if (shape.size() < 2) return 1;
  return static_cast<std::size_t>(shape.size() == 3 && shape[2] == 3 ? shape[1] * shape[2] : shape.back());
}

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
  std::map<std::string, std::vector<float>> stages;
  std::map<std::string, std::size_t> channels;  // of each stage's rows
  LaraResult result;

  ModelRun(Context& ctx, const LaraGolden& golden) {
    const LaraModel model(ctx, golden.config(), golden.weights());
    const ViewDrawings held = drawings(ctx, golden);
    LaraOptions options;
    options.held = &held;
    options.tap = [&](const std::string& name, const Tensor& t) {
      stages[name] = ctx.read<float>(t);
      channels[name] = channels_of(t.shape());
    };
    result = model.forward(ctx, upload(ctx, golden, "input.images"), golden.cameras(), options);
    stages["lifted"] = lifted_by_view(stages.at("lifted.samples"), stages.at("lifted.embedded"), golden.config(),
                                      golden.cameras().size());
    channels["lifted"] = static_cast<std::size_t>(golden.config().lifted_ch());
    stages.erase("lifted.samples");
    stages.erase("lifted.embedded");
  }

  static ViewDrawings drawings(Context& ctx, const LaraGolden& golden) {
    return {upload(ctx, golden, "stage.drawing.image"), upload(ctx, golden, "stage.drawing.alpha"),
            upload(ctx, golden, "stage.drawing.depth")};
  }
};

class LaraVectors : public test::VectorsTest {};

std::vector<std::string> all_cases() {
  std::vector<std::string> out = {"lara_micro"};
  out.insert(out.end(), test::lara_cases().begin(), test::lara_cases().end());
  return out;
}

VSPLAT_VECTORS(LaraVectors, all_cases());
VSPLAT_SLOW_VECTORS(LaraVectors, test::slow_lara_cases());

TEST_P(LaraVectors, EveryStageMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const LaraGolden golden = LaraGolden::load(name());
  const ModelRun run(ctx(), golden);
  EXPECT_EQ(run.result.kept, golden.kept());
  for (const auto& [stage, values] : run.stages) {
    ASSERT_TRUE(golden.has("stage." + stage)) << stage;
    EXPECT_TRUE(test::close_by_channel(values, golden.floats("stage." + stage), run.channels.at(stage), 1e-4)) << stage;
  }
  // features, lifted, volume, samples and output of the fine decoder, two times five fields; three of each layer.
  EXPECT_EQ(run.stages.size(), 15 + 3 * static_cast<std::size_t>(golden.config().layers));
  const int features = golden.config().fine_features;
  if (features == 0) {
    EXPECT_FALSE(run.result.features);
    return;
  }
  const auto output = golden.floats("stage.fine.output");
  const auto width = static_cast<std::size_t>(features + 3 * golden.config().sh_count());
  std::vector<float> want;
  for (std::size_t i = 0; i < output.size(); ++i)
    if (i % width < static_cast<std::size_t>(features)) want.push_back(output[i]);
  EXPECT_TRUE(test::close(ctx().read<float>(run.result.features), want, 1e-4));
}

// 99.9 % of the values within 2e-3 of the largest (at least 1), the mean within 1e-5.
void expect_picture(const std::vector<float>& got, const std::vector<float>& want, const std::string& what) {
  ASSERT_EQ(got.size(), want.size()) << what;
  double largest = 1, sum = 0;
  for (const float v : want) largest = std::max(largest, std::abs(static_cast<double>(v)));
  std::size_t off = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]) / largest;
    ASSERT_TRUE(std::isfinite(error)) << what << " at " << i;
    sum += error;
    off += error > 2e-3;
  }
  EXPECT_LE(static_cast<double>(off), 1e-3 * static_cast<double>(got.size())) << what;
  EXPECT_LE(sum / static_cast<double>(got.size()), 1e-5) << what;
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

GaussianGradients cotangents(Context& ctx, const LaraGolden& golden, const std::string& level) {
  Tensor t[5];
  for (int i = 0; i < 5; ++i) t[i] = upload(ctx, golden, "cotangent." + level + "." + kFields[i]);
  return {t[0], t[1], t[2], t[3], t[4]};
}

GaussianGradients zeros(Context& ctx, const DeviceGaussians& like) {
  const DeviceGaussians made = make_gaussians(ctx, like.count(), like.sh.dim(1), "gradient", like.scales.dim(1));
  for (const Tensor& t : {made.means, made.scales, made.quats, made.opacities, made.sh}) ctx.fill_zero(t);
  return {made.means, made.scales, made.quats, made.opacities, made.sh};
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
  const ViewDrawings held = ModelRun::drawings(ctx, golden);
  LaraOptions options;
  if (which != "final") options.held = &held;
  LaraModel::Trained trained = forward(ctx, model, golden, options, recompute);
  if (which == "coarse")
    model.backward(ctx, trained, cotangents(ctx, golden, "coarse"), {});
  else
    model.backward(ctx, trained, zeros(ctx, trained.result.coarse), cotangents(ctx, golden, "final"));
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
  EXPECT_EQ(ModelRun(ctx(), golden).stages, ModelRun(ctx(), golden).stages);
}

// The fine decoder processes primitives in blocks: the block size does not affect the result, forward or backward, not
// even if a voxel's two primitives are in two blocks.
TEST_P(Lara, FineDecoderInBlocks) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const LearntWeights learnt(ctx(), parameters(golden.config()), golden.weights());
  const LaraFineDecoder decoder(ctx(), golden.config(), learnt);
  const ViewDrawings held = ModelRun::drawings(ctx(), golden);
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
  const ViewDrawings held = ModelRun::drawings(ctx(), golden);
  LaraOptions options;
  options.held = &held;
  const Tensor images = upload(ctx(), golden, "input.images");
  EXPECT_EQ(model.forward(ctx(), images, golden.cameras(), options).final.count(), 0);
  LaraModel::Trained trained = forward(ctx(), model, golden, options, false);
  model.backward(ctx(), trained, cotangents(ctx(), golden, "coarse"), zeros(ctx(), trained.result.final));
  const auto got = ctx().read<float>(learnt.at("decoder.mlp_fine.0.weight").gradient);
  EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f));
}

TEST_P(Lara, MoreViewsThanItHasEmbeddingsForAreRefused) {
  const LaraGolden golden = LaraGolden::load("lara_micro");
  const LaraModel model(ctx(), golden.config(), golden.weights());
  const std::vector<Camera> four(4, golden.cameras()[0]);
  try {
    model.forward(ctx(), ctx().tensor({4, 12, 12, 3}), four, {});
    FAIL() << "ran";
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::usage);
    EXPECT_NE(std::string(e.what()).find("view_slots = 3"), std::string::npos) << e.what();
  }
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
                                           "splat", "refinement"}));

  ContextOptions tight;
  tight.max_memory_gib = 0.6 * static_cast<double>(plan.peak) / (1ull << 30);
  const auto small = test::open_context(GetParam(), tight);
  try {
    const LaraModel model(*small, config, golden.weights());
    const ViewDrawings held = ModelRun::drawings(*small, golden);
    LaraOptions options;
    options.held = &held;
    model.forward(*small, upload(*small, golden, "input.images"), golden.cameras(), options);
    FAIL() << "ran in 60 % of the memory that it needs";
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::memory) << e.what();
  }
}

}  // namespace
}  // namespace vsplat
