// The whole network: every stage, against the PyTorch specification's vectors, and the properties that hold for a run
// as a whole.
#include "model/networks/vsplat/vsplat_model.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "model/render/render.h"
#include "tests/support/compare.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/network_vectors.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::expect_picture;
using test::Golden;

// A run of the model on a golden file's inputs, with every stage's output recorded.
struct ModelRun {
  test::StageOutputs stages;
  ForwardResult result;
  std::vector<Camera> cameras;

  ModelRun(Context& ctx, const Golden& golden) {
    const Config& config = golden.config();
    const VsplatModel model(ctx, config, golden.weights());
    const long edge = config.image, views = golden.views();
    std::vector<float> images = golden.floats("input.images");
    images.resize(static_cast<std::size_t>(views * edge * edge * 3));
    cameras = test::golden_cameras(golden);
    ForwardOptions options;
    options.temperature = golden.temperature();
    if (golden.has("input.noise")) options.noise = test::golden_upload(ctx, golden, "input.noise");
    options.tap = stages.tap(ctx);
    result = model.forward(ctx, ctx.upload({views, edge, edge, 3}, images), upload_cameras(ctx, cameras), options);
  }
};

void expect_stages(const Golden& golden, const ModelRun& run) {
  int compared = 0;
  for (const auto& [name, values] : run.stages.values) {
    ASSERT_TRUE(golden.has("stage." + name)) << name;
    const std::vector<float> want = golden.floats("stage." + name);
    EXPECT_TRUE(test::close_by_channel(values, want, run.stages.channels.at(name), 1e-4)) << name;
    ++compared;
  }
  EXPECT_GE(compared, golden.config().levels == "coarse" ? 13 : 14);
  const int r = golden.config().volume;
  std::vector<std::int64_t> coords;
  for (const int v : run.result.selected)
    for (const int c : {v / (r * r), v / r % r, v % r}) coords.push_back(c);
  EXPECT_EQ(coords, golden.integers("stage.coords"));
}

void expect_pictures(Context& ctx, const Golden& golden, const ModelRun& run) {
  const std::vector<float> background = golden.floats("input.background");
  const std::size_t pixels = static_cast<std::size_t>(golden.config().image) * golden.config().image;
  RenderOptions options;
  options.background = {background[0], background[1], background[2]};
  if (golden.config().negate_camera_centre) options.mirror = std::array<float, 3>{0, 0, 0};
  const std::vector<Camera> cameras = test::golden_all_cameras(golden);
  for (const auto& [level, gaussians] :
       {std::pair{"coarse", &run.result.coarse}, std::pair{"final", &run.result.final}}) {
    std::vector<float> colour, alpha, depth;
    for (const Camera& camera : cameras) {
      const Picture p = render_picture(ctx, *gaussians, camera, options);
      colour.insert(colour.end(), p.colour.data.begin(), p.colour.data.end());
      alpha.insert(alpha.end(), p.alpha.data.begin(), p.alpha.data.end());
      depth.insert(depth.end(), p.depth.data.begin(), p.depth.data.end());
    }
    ASSERT_EQ(alpha.size(), pixels * cameras.size());
    const std::string prefix = std::string("render.") + level + ".";
    expect_picture(colour, golden.floats(prefix + "image"), prefix + "image");
    expect_picture(alpha, golden.floats(prefix + "alpha"), prefix + "alpha");
    expect_picture(depth, golden.floats(prefix + "depth"), prefix + "depth");
  }
}

class GoldenModel : public test::VectorsTest {};

TEST_P(GoldenModel, EveryStageAndPictureMatches) {
  VSPLAT_NEED_GOLDEN(name());
  const Golden golden = Golden::load(name());
  const ModelRun run(ctx(), golden);
  expect_stages(golden, run);
  expect_pictures(ctx(), golden, run);
}

VSPLAT_VECTORS(GoldenModel, test::joined({"micro", "micro_noise"}, test::golden_cases()));
VSPLAT_SLOW_VECTORS(GoldenModel, test::joined({"tiny_seed2"}, test::slow_extension_cases()));
INSTANTIATE_TEST_SUITE_P(Extensions, GoldenModel, test::in_both_flavours(test::extension_cases()), test::vectors_name);

class Model : public test::FlavourTest {};
VSPLAT_FLAVOURS(Model);

TEST_P(Model, TwoRunsGiveTheSameBits) {
  const Golden golden = Golden::load("micro");
  const ModelRun first(ctx(), golden), second(ctx(), golden);
  EXPECT_EQ(first.stages.values, second.stages.values);
  EXPECT_EQ(first.result.selected, second.result.selected);
}

TEST_P(Model, PlanTellsTheMemoryOfTheRun) {
  const Golden golden = Golden::load("micro");
  const Config& config = golden.config();
  const auto plan_ctx = test::open_context(GetParam());
  std::vector<int> forced;
  for (int i = 0; i < config.voxels(); i += 3) forced.push_back(i);
  const MemoryPlan plan =
      VsplatModel::plan(*plan_ctx, config, golden.weights(), golden.views(), static_cast<long>(forced.size()));
  EXPECT_EQ(plan.selected, static_cast<long>(forced.size()));
  EXPECT_EQ(plan_ctx->memory().reserved(), 0u) << "a plan allocates nothing";

  const auto run_ctx = test::open_context(GetParam());
  const VsplatModel model(*run_ctx, config, golden.weights());
  std::vector<float> images = golden.floats("input.images");
  images.resize(static_cast<std::size_t>(golden.views()) * config.image * config.image * 3);
  struct Inputs {
    Tensor images;
    DeviceCameras cameras;
  };
  const auto upload = [&](Context& on) {
    return Inputs{on.upload({golden.views(), config.image, config.image, 3}, images),
                  upload_cameras(on, test::golden_cameras(golden))};
  };
  {  // a slab for measuring, since a slab that an arena makes by itself is larger than micro's total
    const auto planner = run_ctx->planner();
    const Inputs planned = upload(*planner);
    run_ctx->memory().commit(planner->memory());
  }
  const Inputs inputs = upload(*run_ctx);
  ForwardOptions options;
  options.selection = &forced;
  const ForwardResult result = model.forward(*run_ctx, inputs.images, inputs.cameras, options);
  EXPECT_EQ(result.selected, forced);
  EXPECT_EQ(result.final.count(), static_cast<long>(forced.size()) * (config.fine_count + 1));
  EXPECT_EQ(run_ctx->memory().peak(), plan.peak);
  // The memory used in each stage equals the plan's, to the byte.
  const std::set<std::string> drawing{"splat", "project", "sort", "rasterize"};
  std::map<std::string, std::size_t> planned, taken;
  for (const StageMemory& stage : plan.stages)
    if (!drawing.count(stage.stage)) planned[stage.stage] = std::max(planned[stage.stage], stage.peak_live);
  for (const StageMemory& stage : run_ctx->stage_memory())
    if (!stage.stage.empty()) taken[stage.stage] = stage.peak_live;
  EXPECT_EQ(taken, planned);
}

TEST_P(Model, RefusesBeforeItStartsWhatDoesNotFit) {
  const Golden golden = Golden::load("micro");
  const auto probe = test::open_context(GetParam());
  const MemoryPlan plan =
      VsplatModel::plan(*probe, golden.config(), golden.weights(), 2, golden.config().voxels() / 10);
  test::expect_refused_when_tight(GetParam(), plan, [&](Context& small) {
    const VsplatModel model(small, golden.config(), golden.weights());
    std::vector<float> images = golden.floats("input.images");
    images.resize(static_cast<std::size_t>(2) * 16 * 16 * 3);
    model.forward(small, small.upload({2, 16, 16, 3}, images), upload_cameras(small, test::golden_cameras(golden)), {});
  });
}

TEST_P(Model, SelectionSeedMakesARepeatableChoice) {
  const Golden golden = Golden::load("micro");
  const VsplatModel model(ctx(), golden.config(), golden.weights());
  std::vector<float> images = golden.floats("input.images");
  images.resize(static_cast<std::size_t>(2) * 16 * 16 * 3);
  const Tensor pictures = ctx().upload({2, 16, 16, 3}, images);
  const DeviceCameras cameras = upload_cameras(ctx(), test::golden_cameras(golden));
  const auto chosen = [&](std::optional<std::uint64_t> seed) {
    ForwardOptions options;
    options.temperature = 1;
    options.selection_seed = seed;
    return model.forward(ctx(), pictures, cameras, options).selected;
  };
  EXPECT_EQ(chosen(7), chosen(7));
  EXPECT_NE(chosen(7), chosen(8));
}

}  // namespace
}  // namespace vsplat
