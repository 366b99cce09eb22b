// GenDen's network, every stage of it and every gradient, against the PyTorch specification's vectors; and the
// properties that hold of a run as a whole.
#include "model/networks/genden/genden_model.h"

#include <gtest/gtest.h>

#include <set>

#include "model/networks/params/params.h"
#include "model/ops/networks/decode.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/cell_map.h"
#include "tests/support/compare.h"
#include "tests/support/lara_golden.h"
#include "tests/support/network_vectors.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::drawings;
using test::GendenGolden;
using test::upload;

CurveOrders orders_of(const GendenGolden& golden) {
  const std::vector<int> all = golden.integers("input.orders");
  const auto each = static_cast<long>(all.size() / golden.config().densify.levels());
  CurveOrders out;
  for (auto at = all.begin(); at != all.end(); at += each) out.emplace_back(at, at + each);
  return out;
}

class GendenVectors : public test::VectorsTest {};
VSPLAT_VECTORS(GendenVectors, test::joined({"genden_micro"}, test::genden_cases()));
VSPLAT_SLOW_VECTORS(GendenVectors, test::slow_genden_cases());

// A run of the model on a golden file's inputs, with every stage's output recorded and the renderings fixed.
struct ModelRun {
  test::StageOutputs stages;
  GendenResult result;

  ModelRun(Context& ctx, const GendenGolden& golden, bool by_seed = false) {
    const GendenModel model(ctx, golden.config(), golden.weights());
    const ViewDrawings held = drawings(ctx, golden);
    GendenOptions options;
    options.backbone.held = &held;
    options.backbone.tap = stages.tap(ctx);
    if (by_seed)
      options.seed = std::stoull(golden.file().metadata().at("seed"));
    else
      options.orders = orders_of(golden);
    result = model.forward(ctx, upload(ctx, golden, "input.images"), golden.cameras(), options);
    stages.values.erase("lifted.samples");
    stages.values.erase("lifted.embedded");
  }
};

TEST_P(GendenVectors, EveryStageMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const GendenGolden golden = GendenGolden::load(name());
  const ModelRun run(ctx(), golden);
  EXPECT_EQ(run.result.kept, golden.kept());
  for (const auto& [stage, values] : run.stages.values) {
    ASSERT_TRUE(golden.has("stage." + stage)) << stage;
    const auto want = golden.floats("stage." + stage);
    // The sum of many small numbers is compared relative to the largest of them.
    if (stage == "score" || stage == "pull")
      EXPECT_TRUE(test::close(values, want, 1e-4)) << stage;
    else
      EXPECT_TRUE(test::close_by_channel(values, want, run.stages.channels.at(stage), 1e-4)) << stage;
  }
  // The backbone: features, volume, samples and output of the fine decoder, and three of each layer. Then pull,
  // score and selection, and three times five fields. Of each level: three of each block, offset, xyz, feature and
  // attributes, and, except for the last level, confidence.
  std::size_t stages = 4 + 3 * static_cast<std::size_t>(golden.config().layers) + 3 + 15;
  for (const int blocks : golden.config().densify.depths) stages += 3 * static_cast<std::size_t>(blocks) + 5;
  EXPECT_EQ(run.stages.values.size(), stages - 1);
}

// The positions of each level's points, their order and their neighbours must match exactly.
TEST_P(GendenVectors, PlacesOfEveryLevelMatch) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const GendenGolden golden = GendenGolden::load(name());
  const DensifyConfig& d = golden.config().densify;
  const auto rows_of = [&](const std::string& tensor, const std::vector<int>& index) {
    const auto all = golden.floats(tensor);
    std::vector<float> out;
    for (const int i : index) out.insert(out.end(), all.begin() + 3L * i, all.begin() + 3L * i + 3);
    return out;
  };
  std::vector<float> points = rows_of("stage.kept.means", golden.integers("stage.selected"));
  double cell = d.cell;
  for (std::size_t s = 0; s < d.levels(); ++s) {
    SCOPED_TRACE("level " + std::to_string(s));
    const std::string level = "stage.level." + std::to_string(s) + ".";
    const long p = static_cast<long>(points.size()) / 3;
    const GridCells cells = grid_cells(ctx(), ctx().upload({p, 3}, points), cell);
    EXPECT_EQ(ctx().read<int>(cells.cells), golden.integers(level + "cells"));
    const std::vector<std::int64_t> codes = golden.file().integers(golden.file().at(level + "codes"));
    const std::vector<int> orders = golden.integers(level + "orders");
    const std::vector<CurveName> curves = curves_of(d);
    for (std::size_t i = 0; i < curves.size(); ++i) {
      const Tensor made =
          curve_codes(ctx(), cells, curves[i].hilbert ? Curve::hilbert : Curve::morton, curves[i].exchanged);
      const auto got = ctx().read<std::uint64_t>(made);
      const auto from = codes.begin() + static_cast<long>(i) * p;
      EXPECT_EQ(got, std::vector<std::uint64_t>(from, from + p)) << "curve " << i;
      const Sorted sorted = radix_sort(ctx(), made, {}, 3 * cells.depth);
      const auto order = ctx().read<std::uint32_t>(sorted.values);
      for (std::size_t at = 0; at < curves.size(); ++at) {
        if (static_cast<std::size_t>(orders_of(golden)[s][at]) != i) continue;  // another place in the permutation
        for (std::size_t k = 0; k < order.size(); ++k)
          ASSERT_EQ(static_cast<int>(order[k]), orders[at * order.size() + k]) << "curve " << i;
      }
      if (i > 0) continue;
      const Tensor standing = ctx().tensor({p}, Type::i32), map = ctx().tensor({p, 27}, Type::i32);
      cell_map_forward(ctx(), {cells, sorted.keys, sorted.values, d.duplicates == "all", standing, map});
      std::vector<int> rows = golden.integers(level + "rows");
      for (int& row : rows) row = row == p ? -1 : row;
      EXPECT_EQ(ctx().read<int>(map), rows);
    }
    if (s + 1 == d.levels()) break;
    const std::vector<int> leaf = golden.integers(level + "leaf");
    const std::set<int> leaves(leaf.begin(), leaf.end());
    std::vector<int> on;
    const long children = static_cast<long>(golden.floats(level + "xyz").size()) / 3;
    for (int i = 0; i < children; ++i)
      if (leaves.count(i) == 0) on.push_back(i);
    points = rows_of(level + "xyz", on);
    cell /= d.stride;
  }
}

// The gradients by all weights for cotangents on one level alone, named as in the specification: "coarse"; "fixed", for
// the final Gaussians with constant drawings; "final", through the product's own drawings.
std::map<std::string, std::vector<float>> gradients(Context& ctx, const GendenGolden& golden, const std::string& which,
                                                    bool recompute) {
  const LearntWeights learnt(ctx, parameters(golden.config()), golden.weights());
  const GendenModel model(ctx, golden.config(), learnt);
  const ViewDrawings held = drawings(ctx, golden);
  const Tensor score = upload(ctx, golden, "stage.score");
  GendenOptions options;
  if (which != "final") options.backbone.held = &held;
  options.score = &score;
  options.orders = orders_of(golden);
  GendenModel::Trained trained =
      model.forward_in_training(ctx, upload(ctx, golden, "input.images"), golden.cameras(), options, recompute);
  if (which == "coarse")
    model.backward(ctx, trained, test::cotangents(ctx, golden, "coarse"), {});
  else
    model.backward(ctx, trained, zero_gradients(ctx, trained.result.coarse.count(), golden.config().sh_degree),
                   test::cotangents(ctx, golden, "final"));
  std::map<std::string, std::vector<float>> out;
  for (const std::string& name : learnt.names()) out[name] = ctx.read<float>(learnt.at(name).gradient);
  return out;
}

TEST_P(GendenVectors, EveryGradientMatches) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const GendenGolden golden = GendenGolden::load(name());
  for (const std::string which : {"coarse", "fixed", "final"}) {
    const std::string prefix = "cograd." + which + ".";
    // A softmax does not change if all of its logits move together.
    const char* rounding = golden.config().densify.residual ? "mask.net.2.bias" : "";
    const int compared = test::expect_gradients(golden, prefix, gradients(ctx(), golden, which, false), rounding);
    // Without a gradient by the coarse Gaussians, only the fine decoder and the densifier have gradients.
    const int all = static_cast<int>(parameters(golden.config()).size()),
              backbone = static_cast<int>(parameters(static_cast<const LaraConfig&>(golden.config())).size());
    EXPECT_EQ(compared, which == "coarse" ? backbone - 10 : all) << prefix;
  }
}

// The permutations of the curves are those that PyTorch draws from the seed.
TEST_P(GendenVectors, OrdersFollowTheSeed) {
  VSPLAT_NEED_LARA_GOLDEN(name());
  const GendenGolden golden = GendenGolden::load(name());
  const auto seed = std::stoull(golden.file().metadata().at("seed"));
  EXPECT_EQ(random_orders(golden.config().densify, seed), orders_of(golden));
}

class Genden : public test::FlavourTest {};
VSPLAT_FLAVOURS(Genden);

TEST_P(Genden, RunningOnceMoreGivesTheSameGradients) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  const auto kept = gradients(ctx(), golden, "final", false);
  EXPECT_EQ(gradients(ctx(), golden, "final", true), kept);
  EXPECT_EQ(gradients(ctx(), golden, "final", false), kept);
}

TEST_P(Genden, TwoRunsGiveTheSameBitsAndSoDoesTheSeed) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  const ModelRun first(ctx(), golden);
  EXPECT_EQ(ModelRun(ctx(), golden).stages.values, first.stages.values);
  EXPECT_EQ(ModelRun(ctx(), golden, true).stages.values, first.stages.values);
}

// If no Gaussian is opaque enough, nothing is densified, and nothing fails.
TEST_P(Genden, NothingKept) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  GendenConfig config = golden.config();
  config.opacity_threshold = 0.9999;
  const LearntWeights learnt(ctx(), parameters(config), golden.weights());
  const GendenModel model(ctx(), config, learnt);
  const ViewDrawings held = drawings(ctx(), golden);
  GendenOptions options;
  options.backbone.held = &held;
  const Tensor images = upload(ctx(), golden, "input.images");
  EXPECT_EQ(model.forward(ctx(), images, golden.cameras(), options).final.count(), 0);
  GendenModel::Trained trained = model.forward_in_training(ctx(), images, golden.cameras(), options, false);
  model.backward(ctx(), trained, test::cotangents(ctx(), golden, "coarse"), zero_gradients(ctx(), 0, config.sh_degree));
  const auto got = ctx().read<float>(learnt.at("dec.0.up.skip.weight").gradient);
  EXPECT_EQ(got, std::vector<float>(got.size(), 0.0f));
}

TEST_P(Genden, WrongOrdersAreRefused) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  const GendenModel model(ctx(), golden.config(), golden.weights());
  const ViewDrawings held = drawings(ctx(), golden);
  GendenOptions options;
  options.backbone.held = &held;
  const Tensor images = upload(ctx(), golden, "input.images");
  for (const CurveOrders& orders : {CurveOrders{{0, 1, 2, 3}}, {{0, 1, 2}, {0, 1, 2}}, {{4, 1, 2, 3}, {0, 1, 2, 3}}}) {
    options.orders = orders;
    EXPECT_THROW(model.forward(ctx(), images, golden.cameras(), options), Error);
  }
}

TEST_P(Genden, PlanTellsTheMemoryOfTheRun) {
  const GendenGolden golden = GendenGolden::load("genden_micro");
  const auto views = static_cast<long>(golden.cameras().size()), kept = static_cast<long>(golden.kept().size());
  const auto plan_ctx = test::open_context(GetParam());
  const MemoryPlan plan = GendenModel::plan(*plan_ctx, golden.config(), golden.weights(), views, kept);
  EXPECT_EQ(plan.selected, kept);
  EXPECT_EQ(plan_ctx->memory().reserved(), 0U) << "a plan allocates nothing";
  std::set<std::string> stages;
  for (const StageMemory& stage : plan.stages) stages.insert(stage.stage);
  EXPECT_TRUE(stages.count("densify"));
  test::expect_refused_when_tight(GetParam(), plan, [&](Context& small) {
    const GendenModel model(small, golden.config(), golden.weights());
    const ViewDrawings held = drawings(small, golden);
    GendenOptions options;
    options.backbone.held = &held;
    model.forward(small, upload(small, golden, "input.images"), golden.cameras(), options);
  });
}

}  // namespace
}  // namespace vsplat
