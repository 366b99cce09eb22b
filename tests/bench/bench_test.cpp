#include "bench/bench.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "bench/earlier_run.h"
#include "bench/forward_check.h"
#include "bench/scenes.h"
#include "model/cli/bench_options.h"
#include "model/io/scene/ply.h"
#include "model/io/views/cameras_json.h"
#include "model/networks/params/init.h"
#include "model/networks/params/model_file.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

TEST(Bench, ReportsEachCaseAgainstPeaksOfTheSameRun) {
  bench::Options options;
  options.suites = {"gemm", "conv3d"};
  options.filter = "small.16";
  options.seconds = 0;
  std::vector<std::string> seen;
  options.on_progress = [&](const bench::CaseProgress& p) {
    if (p.doing == "preparing") seen.push_back(p.name);
    EXPECT_EQ(p.at, 0u);
    EXPECT_EQ(p.all, 1u);
  };
  const bench::Report report = bench::run(test::context(Flavour::cpu), options);
  ASSERT_EQ(report.results.size(), 1u);
  EXPECT_EQ(seen, std::vector<std::string>{"conv3d/small.16.128-128"});
  const bench::Result& r = report.results[0];
  EXPECT_GT(report.peak_gflops, 0);
  EXPECT_GT(report.peak_gbs, 0);
  EXPECT_GT(r.median_s, 0);
  EXPECT_NEAR(r.gflops * r.median_s * 1e9, 2.0 * 27 * 4096 * 128 * 128, 1e3);
  EXPECT_NEAR(r.share_of_peak, r.performed_gflops / report.peak_gflops, 1e-12);
  const auto json = nlohmann::json::parse(bench::json(report));
  EXPECT_EQ(json["results"][0]["name"], "small.16.128-128");
  EXPECT_EQ(json["results"][0]["kind"], "compute");
  EXPECT_NE(bench::table(report).find("conv3d/small.16.128-128"), std::string::npos);
}

TEST(Bench, HasTheSuitesThatTheCommandNames) { EXPECT_EQ(bench::suite_names(), command::bench_suites()); }

// Runs each operation at the benchmark's sizes: the inputs fit the operation, and it gives a result.
TEST(Bench, RunsEveryOperation) {
  std::vector<std::string> most = bench::operation_names();
  most.erase(std::remove(most.begin(), most.end(), "sparse_conv"), most.end());
  std::set<std::string> ran;
  const auto run = [&](const std::vector<std::string>& suites, const std::string& filter) {
    bench::Options options;
    options.suites = suites;
    options.filter = filter;
    options.seconds = 0;
    for (const bench::Result& r : bench::run(test::context(Flavour::cpu), options).results) {
      ran.insert(r.suite);
      EXPECT_GT(r.median_s, 0) << r.suite << "/" << r.name;
      EXPECT_GT(r.gflops + r.gbs, 0) << r.suite << "/" << r.name << ": its launches say what they cost";
      EXPECT_TRUE(r.kind == bench::Kind::compute || r.kind == bench::Kind::memory);
      EXPECT_LE(r.error.value_or(0), 1e-4) << r.suite << "/" << r.name;  // most are sampled, not compared
    }
  };
  run(most, "");
  run({"sparse_conv"}, "forward");  // the backward pass takes ten seconds at the paper's size
  EXPECT_EQ(ran.size(), bench::operation_names().size());
}

TEST(Bench, DrawsScenesAndSaysWhereTheirTimeWent) {
  bench::Options options;
  options.suites = {"render"};
  options.filter = "small";
  options.seconds = 0;
  for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
    const bench::Report report = bench::run(test::context(flavour), options);
    ASSERT_EQ(report.results.size(), 2u);
    const auto json = nlohmann::json::parse(bench::json(report));
    for (const std::size_t at : {0, 1}) {
      const bench::Result& r = report.results[at];
      EXPECT_EQ(r.name, "small-5k");
      EXPECT_EQ(r.kind, at ? bench::Kind::backward : bench::Kind::forward);
      EXPECT_GT(r.median_s, 0);
      EXPECT_GT(r.gflops, 0);
      EXPECT_GT(r.error, 0);  // a picture in float32, and not only background
      EXPECT_LE(r.error, 1e-5);
      double sum = 0;
      for (const auto& [stage, share] : r.stages) sum += share;
      EXPECT_NEAR(sum, 1, 0.02);
      for (const char* stage : {"project", "sort", "bin", "rasterize"}) EXPECT_GT(r.stages.at(stage), 0) << stage;
      EXPECT_EQ(r.stages.count("rasterize_backward"), at);
      EXPECT_EQ(r.stages.count("project_backward"), at);
      EXPECT_EQ(json["results"][at]["kind"], at ? "backward" : "forward");
      EXPECT_EQ(json["results"][at]["stages"].size(), r.stages.size());
      EXPECT_TRUE(json["results"][at]["reference"].empty());
    }
  }
}

// With the scenes of a folder instead: the same scene, written and read back.
TEST(Bench, DrawsTheScenesOfAFolder) {
  const test::TemporaryFolder folder;
  const bench::BenchScene made = bench::make_scene("small-5k");
  write_ply(folder.path("small-5k.ply"), made.scene);
  write_cameras(folder.path("small-5k.cameras.json"), made.cameras);
  const bench::BenchScene read = bench::read_scene(folder.path(), "small-5k");
  EXPECT_EQ(read.scene.gaussians.means, made.scene.gaussians.means);
  ASSERT_EQ(read.cameras.size(), 8u);
  EXPECT_EQ(read.cameras[3].w2c, made.cameras[3].w2c);
  EXPECT_EQ(read.cameras[3].width, 128);
  EXPECT_THROW(bench::read_scene(folder.path(), "slab-1m"), Error);
  write_ply(folder.path("alone.ply"), made.scene);  // without cameras
  EXPECT_EQ(bench::scene_names(folder.path()), std::vector<std::string>{"small-5k"});
  EXPECT_THROW(bench::scene_names(folder.path("nowhere")), Error);

  // Cameras of different sizes, forward and backward.
  std::vector<Camera> cameras = made.cameras;
  cameras[1].width = 40, cameras[1].height = 30;
  write_cameras(folder.path("small-5k.cameras.json"), cameras);
  bench::Options options;
  options.suites = {"render"};
  options.filter = "small";
  options.seconds = 0;
  options.scenes = folder.path();
  EXPECT_EQ(bench::run(test::context(Flavour::cpu), options).results.size(), 2u);
}

TEST(Bench, MakesScenesOfTheSizesTheyAreNamedFor) {
  const bench::BenchScene object = bench::make_scene("object-190k");
  EXPECT_EQ(object.scene.gaussians.count, 188003u);
  EXPECT_EQ(object.scene.gaussians.sh.size(), 188003u * 4 * 3);
  EXPECT_EQ(object.cameras.size(), 8u);
  EXPECT_EQ(object.cameras[0].width, 512);
  EXPECT_THROW(bench::make_scene("slab"), Error);
}

// Uses a model small enough for a test.
TEST(Bench, TrainsAndSaysWhichKernelTookHowLong) {
  const test::TemporaryFolder folder;
  bench::Options options;
  options.suites = {"train"};
  options.seconds = 0;
  options.model = folder.path("model.safetensors");
  const Config config = named_config("tiny");
  save_model(options.model, config, initial_weights(config, 3));
  const bench::Report report = bench::run(test::context(Flavour::cpu), options);
  ASSERT_EQ(report.results.size(), 2u);
  EXPECT_EQ(report.results[0].name, "small network");
  EXPECT_EQ(report.results[1].name, "small step");
  const auto json = nlohmann::json::parse(bench::json(report));
  for (const std::size_t at : {0, 1}) {
    const bench::Result& r = report.results[at];
    EXPECT_EQ(r.kind, bench::Kind::training);
    EXPECT_GT(r.error, 0);
    double of_stages = 0, of_kernels = 0;
    for (const auto& [stage, share] : r.stages) of_stages += stage == "host" ? 0 : share;
    for (const bench::KernelTime& k : r.kernels) of_kernels += k.seconds;
    EXPECT_NEAR(of_kernels, of_stages * std::max(r.median_s, of_kernels), 1e-6 * of_kernels);
    for (const char* stage : {"encoder", "lifting", "volume", "refinement"}) EXPECT_GT(r.stages.at(stage), 0) << stage;
    EXPECT_EQ(r.stages.count("rasterize"), at);
    EXPECT_EQ(json["results"][at]["kernels"].size(), r.kernels.size());
    EXPECT_NE(bench::table(report).find(r.kernels[0].name), std::string::npos);
  }
}

TEST(Bench, RefusesOtherThanFourViewsToTrainOn) {
  const test::TemporaryFolder folder;
  write_cameras(folder.path("cameras.json"), bench::make_scene("small-5k").cameras);
  bench::Options options;
  options.suites = {"train"};
  options.cameras = folder.path("cameras.json");
  EXPECT_THROW(bench::run(test::context(Flavour::cpu), options), Error);
}

// The first case must say so as well, once one of its runs was timed.
TEST(Bench, SaysHowLongItWillTake) {
  bench::Options options;
  options.suites = {"scan"};
  options.seconds = 0.01;
  std::vector<std::pair<std::string, double>> reported;
  options.on_progress = [&](const bench::CaseProgress& p) { reported.emplace_back(p.doing, p.left_s); };
  bench::run(test::context(Flavour::cpu), options);
  ASSERT_GE(reported.size(), 7u);
  EXPECT_EQ(reported[0].first, "checking");  // the operation's case of the self-test
  EXPECT_EQ(reported[1].first, "preparing");
  EXPECT_LT(reported[1].second, 0);
  EXPECT_EQ(reported[5].first, "run 2");
  EXPECT_GT(reported[5].second, 0);
}

// Every layer is checked at sampled outputs; a stage's limit is the minimum time of its kernels.
TEST(Bench, ANetworkIsCheckedAndStandsAgainstItsStagesLimits) {
  bench::Options options;
  options.suites = {"model"};
  options.filter = "tiny";
  options.seconds = 0;
  const bench::Report report = bench::run(test::context(Flavour::cpu), options);
  ASSERT_EQ(report.results.size(), 1u);
  const bench::Result& r = report.results[0];
  EXPECT_EQ(r.kind, bench::Kind::network);
  ASSERT_TRUE(r.error);
  EXPECT_GT(*r.error, 0);
  EXPECT_LT(*r.error, 1e-4);
  std::map<std::string, bench::StageTime> stages;
  double flops = 0;
  for (const bench::StageTime& s : r.by_stage) stages[s.name] = s, flops += s.gflops * s.seconds * 1e9;
  for (const char* stage : {"encoder", "modulation", "lifting", "volume", "heads", "selection", "refinement", "decode"})
    EXPECT_GT(stages[stage].limit_s, 0) << stage;
  EXPECT_NEAR(flops, r.gflops * r.median_s * 1e9, 1e-6 * flops);
  const bench::StageTime& volume = stages["volume"];
  EXPECT_GE(volume.limit_s, volume.performed_gflops * volume.seconds / report.peak_gflops * (1 - 1e-9));
  EXPECT_GE(volume.limit_s, volume.gbs * volume.seconds / report.peak_gbs * (1 - 1e-9));
  const auto json = nlohmann::json::parse(bench::json(report));
  EXPECT_EQ(json["results"][0]["by_stage"].size(), r.by_stage.size());
}

// A weight that is wrong on the device is found in the layer that uses it.
TEST(Bench, AWrongLayerOfANetworkIsNamed) {
  Context& ctx = test::context(Flavour::cpu);
  bench::ModelInput in = bench::model_input(ctx, "tiny");
  const VsplatModel model(ctx, in.config, in.weights);
  std::string worst;
  EXPECT_LT(bench::model_error(ctx, in, model, &worst), 1e-4);
  const std::pair<const char*, const char*> wrong[] = {{"predictor.fine_predictor.4.bias", "final."},
                                                       {"predictor.coarse_predictor.4.bias", "coarse."}};
  for (const auto& [name, layer] : wrong) {
    bench::ModelInput other = in;
    HostTensor changed = in.weights.at(name);
    for (float& v : changed.data) v += 0.5f;
    other.weights.set(name, changed);
    EXPECT_GT(bench::model_error(ctx, other, model, &worst), 1e-3);
    EXPECT_EQ(worst.rfind(layer, 0), 0u) << worst;
  }
  // A stage's result is compared both from the forward pass and from its own layers.
  bench::ModelInput other = in;
  HostTensor changed = in.weights.at("volume_network.conv_out.bias");
  for (float& v : changed.data) v += 0.5f;
  other.weights.set("volume_network.conv_out.bias", changed);
  EXPECT_GT(bench::model_error(ctx, other, model, &worst), 1e-3);
  EXPECT_EQ(worst, "volume");
}

// Other libraries run in alternation with ours if they were present at build time; otherwise the report says that they
// were not.
TEST(Bench, TimesOtherLibrariesAtTheSameTask) {
  Context& ctx = test::context(Flavour::cpu);
  bench::Options options;
  options.suites = {"gemm", "conv3d"};
  options.seconds = 0;
  options.references = true;
  for (const char* name : {"small.head", "small.16"}) {
    options.filter = name;
    const bench::Report report = bench::run(ctx, options);
    ASSERT_EQ(report.results.size(), 1u);
    const bench::Result& r = report.results[0];
    if (report.references.rfind("without OpenBLAS and oneDNN: ", 0) == 0) {
      EXPECT_EQ(r.reference.count("onednn") + r.reference.count("openblas"), 0u);
      continue;
    }
    EXPECT_EQ(report.references.rfind("beside ", 0), 0u) << report.references;
    const auto built_with = [&](const char* library) { return report.references.find(library) != std::string::npos; };
    EXPECT_EQ(r.reference.count("onednn"), built_with("oneDNN") ? 1u : 0u);
    EXPECT_EQ(r.reference.count("openblas"), built_with("OpenBLAS") && r.suite == "gemm" ? 1u : 0u);
    EXPECT_NE(bench::table(report).find(report.references), std::string::npos);
  }
}

TEST(Bench, ARunIsComparedWithAnEarlierOne) {
  const test::TemporaryFolder folder;
  bench::Report before;
  before.device = "d", before.driver = "1", before.kernels = "cpu", before.peak_gflops = 100, before.peak_gbs = 10;
  const auto add = [](bench::Report& to, const char* name, double median, double spread) {
    bench::Result r;
    r.suite = "gemm", r.name = name, r.median_s = median, r.spread = spread;
    to.results.push_back(r);
  };
  bench::Report now = before;
  now.driver = "2";
  for (const auto& [name, old_s, new_s, spread] : {std::tuple{"slower", 1.0, 1.1, 0.05},
                                                   {"within the spread", 1.0, 1.1, 0.2},
                                                   {"faster", 1.0, 0.9, 0.05},
                                                   {"same", 1.0, 1.02, 0.0},
                                                   {"twice", 1.0, 2.0, 0.0},
                                                   {"twice", 2.0, 2.0, 0.0}})
    add(before, name, old_s, spread), add(now, name, new_s, 0);
  add(before, "gone", 1, 0);
  add(now, "new", 1, 0);
  const std::string path = folder.path("before.json");
  test::put_file(path, bench::json(before));
  const bench::Comparison compared = bench::compare(bench::read_report(path), now);
  std::vector<std::string> verdicts;
  for (const bench::ComparedCase& c : compared.cases) verdicts.push_back(c.verdict);
  EXPECT_EQ(verdicts, (std::vector<std::string>{"slower", "same", "faster", "same", "slower", "same", "new"}));
  EXPECT_NEAR(compared.cases[0].slower_by, 0.1, 1e-12);
  EXPECT_EQ(compared.not_run, 1u);
  ASSERT_EQ(compared.differ.size(), 1u);
  EXPECT_NE(compared.differ[0].find("driver"), std::string::npos);

  test::put_file(path, R"({"device": "d"})");
  EXPECT_THROW(bench::read_report(path), Error);
}

TEST(Bench, UnknownSuiteIsAnErrorThatListsThem) {
  bench::Options options;
  options.suites = {"gem"};
  test::expect_error(Status::usage, {"gemm"}, [&] { bench::run(test::context(Flavour::cpu), options); });
}

}  // namespace
}  // namespace vsplat
