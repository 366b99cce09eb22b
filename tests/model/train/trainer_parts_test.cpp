// A step's gradients in shards: the sum follows the order of the shards, whichever device computed them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "model/networks/params/params.h"
#include "model/train/trainer.h"
#include "runtime/log.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"

namespace vsplat {
namespace {

using test::Golden;

constexpr long kObjects = 5;  // shards of one and of two objects

class TrainerParts : public ::testing::Test {
 protected:
  TrainerParts() : golden_(Golden::load("micro")) {
    TrainingViews first;
    first.object = "golden";
    first.pictures = golden_.floats("input.images");
    first.cameras = test::golden_all_cameras(golden_);
    first.inputs = golden_.views();
    first.background = {1, 1, 1};
    for (long i = 0; i < kObjects; ++i) {  // each has another picture, so that mixed-up objects show
      views_.push_back(first);
      for (float& value : views_.back().pictures) value *= 1 - 0.13f * static_cast<float>(i);
    }
    for (const TrainingViews& v : views_) items_.push_back({&v, v.background});
    start_.config.model = golden_.config();
    start_.config.schedule = {0.01, 0, 10, 1.0, 0.1, 9};
    start_.config.accumulate = kObjects;
    start_.parameters = golden_.weights();
  }

  Checkpoint with_parts(long parts) const {
    Checkpoint out = start_;
    out.config.parts = parts;
    return out;
  }
  // The state after so many steps on `flavours`, the first of which runs the optimiser.
  Checkpoint trained(const Checkpoint& start, const std::vector<Flavour>& flavours, int steps) {
    std::vector<Context*> contexts;
    int taken[2] = {};
    for (const Flavour flavour : flavours) contexts.push_back(&context(flavour, taken[flavour == Flavour::gpu]++));
    Trainer trainer(*contexts[0], start, 0, {contexts.begin() + 1, contexts.end()});
    for (int i = 0; i < steps; ++i) reports_.push_back(trainer.step(items_));
    return trainer.checkpoint();
  }
  // The n-th context of that flavour, kept so that kernels compile once.
  static Context& context(Flavour flavour, int n) {
    std::unique_ptr<Context>& slot = contexts_[{flavour == Flavour::gpu, n}];
    if (!slot) slot = test::open_context(flavour);
    return *slot;
  }
  static void TearDownTestSuite() { contexts_.clear(); }
  static void expect_equal(const Checkpoint& a, const Checkpoint& b) {
    ASSERT_GT(a.parameters.all().size(), 50U);
    for (const auto& [name, value] : a.parameters.all()) EXPECT_EQ(value.data, b.parameters.at(name).data) << name;
    for (const auto& [name, value] : a.m.all()) EXPECT_EQ(value.data, b.m.at(name).data) << name;
    EXPECT_EQ(a.state, b.state);
  }

  static inline std::map<std::pair<bool, int>, std::unique_ptr<Context>> contexts_;
  const Golden golden_;
  std::vector<TrainingViews> views_;
  std::vector<StepItem> items_;
  Checkpoint start_;
  std::vector<StepReport> reports_;
};

// The gradient of a step in shards is the mean over all of its objects, as in a step at once. Adam's first moments
// after the first step are that gradient up to factors.
TEST_F(TrainerParts, TheSumIsThatOfAllObjects) {
  const Checkpoint whole = trained(with_parts(1), {Flavour::cpu}, 1);
  for (const long parts : {2L, 3L, kObjects}) {
    const Checkpoint got = trained(with_parts(parts), {Flavour::cpu}, 1);
    EXPECT_NEAR(reports_.back().loss, reports_.front().loss, 1e-6 * reports_.front().loss);
    EXPECT_NEAR(reports_.back().psnr, reports_.front().psnr, 1e-6);
    EXPECT_NEAR(reports_.back().selected, reports_.front().selected, 1e-9);
    EXPECT_NEAR(reports_.back().gradient_norm, reports_.front().gradient_norm, 1e-5 * reports_.front().gradient_norm);
    EXPECT_EQ(reports_.back().most_selected, reports_.front().most_selected);
    EXPECT_EQ(reports_.back().intersections, reports_.front().intersections);
    for (const auto& [name, m] : whole.m.all()) EXPECT_TRUE(test::close(got.m.at(name).data, m.data, 1e-4)) << name;
  }
}

TEST_F(TrainerParts, HowManyDevicesChangesNoBit) {
  const Checkpoint one = trained(with_parts(3), {Flavour::cpu}, 3);
  EXPECT_EQ(one.state, (std::map<std::string, std::string>{{"precision", "fp32"}, {"tuning", ""}}));
  expect_equal(one, trained(with_parts(3), {Flavour::cpu, Flavour::cpu}, 3));
  const Checkpoint three = trained(with_parts(3), {Flavour::cpu, Flavour::cpu, Flavour::cpu}, 2);
  expect_equal(one, trained(three, {Flavour::cpu, Flavour::cpu}, 1));  // resumed with fewer devices
  const Checkpoint other = trained(with_parts(2), {Flavour::cpu, Flavour::cpu}, 3);
  std::size_t different = 0;
  for (const auto& [name, value] : one.parameters.all()) different += value.data != other.parameters.at(name).data;
  EXPECT_GT(different, 0U) << "the parts change nothing: nothing is tested";
}

TEST_F(TrainerParts, EachPartStaysWithItsKindOfDevice) {
  const Checkpoint begun = trained(with_parts(4), {Flavour::cpu, Flavour::gpu}, 1);
  ASSERT_EQ(begun.state.count("part_devices"), 1U);
  const std::string kinds = begun.state.at("part_devices");
  EXPECT_EQ(std::count(kinds.begin(), kinds.end(), '\n'), 4);
  const Checkpoint first = trained(begun, {Flavour::cpu, Flavour::gpu}, 2);
  EXPECT_EQ(first.state.at("part_devices"), kinds);
  expect_equal(first, trained(begun, {Flavour::cpu, Flavour::gpu}, 2));
  expect_equal(first, trained(begun, {Flavour::cpu, Flavour::gpu, Flavour::gpu}, 2));
}

TEST_F(TrainerParts, OtherKindsAreReported) {
  Checkpoint begun = trained(with_parts(4), {Flavour::cpu, Flavour::gpu}, 1);
  begun.state["part_devices"] = "gone\ngone\ngone\ngone\n";
  std::vector<std::string> warnings;
  set_log_sink([&](LogLevel level, const std::string& text) {
    if (level == LogLevel::warning) warnings.push_back(text);
  });
  const Checkpoint after = trained(begun, {Flavour::cpu}, 2);
  set_log_sink({});
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("other kinds"), std::string::npos);
  EXPECT_EQ(after.state.count("part_devices"), 0U);
}

// A helper that has memory for the weights, but not for an object.
TEST_F(TrainerParts, OthersDoTheWorkOfOneThatFails) {
  const Checkpoint wanted = trained(with_parts(kObjects), {Flavour::cpu}, 2);
  const std::unique_ptr<Context> empty_one = test::open_context(Flavour::cpu), planner = empty_one->planner();
  const Checkpoint empty = [&] {
    Checkpoint out = with_parts(kObjects);
    out.parameters = {};
    return out;
  }();
  const Trainer planned(*planner, empty);
  const double weights = static_cast<double>(planner->memory().peak());
  const double gib = static_cast<double>(1ull << 30);
  ContextOptions little;
  little.max_memory_gib = 1.01 * weights / gib;
  const std::unique_ptr<Context> small = test::open_context(Flavour::cpu, little);
  std::vector<std::string> warnings;
  set_log_sink([&](LogLevel level, const std::string& text) {
    if (level == LogLevel::warning) warnings.push_back(text);
  });
  Trainer trainer(context(Flavour::cpu, 0), with_parts(kObjects), 0, {small.get()});
  for (int i = 0; i < 2; ++i) trainer.step(items_);
  set_log_sink({});
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].find("no more parts"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[0].find("not enough device memory"), std::string::npos) << warnings[0];
  expect_equal(wanted, trainer.checkpoint());
}

TEST_F(TrainerParts, BeingToldToStopMovesNothing) {
  Context& main = context(Flavour::cpu, 0);
  Trainer trainer(main, with_parts(kObjects), 0, {&context(Flavour::cpu, 1)});
  trainer.step(items_);
  const Checkpoint before = trainer.checkpoint();
  main.cancel();
  EXPECT_THROW(trainer.step(items_), Error);
  main.go_on();
  expect_equal(before, trainer.checkpoint());
  trainer.step(items_);
  expect_equal(trained(with_parts(kObjects), {Flavour::cpu}, 2), trainer.checkpoint());
}

}  // namespace
}  // namespace vsplat
