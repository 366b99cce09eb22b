// A search's table: the content of its file at each moment.
#include "model/diagnose/tune/tried_table.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "model/diagnose/tune/search.h"
#include "tests/support/device.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using tuning::TriedTable;

// Uses its own cache, and an operation with three sets that take little time.
class SearchTable : public ::testing::Test {
 protected:
  static const TunedDeclaration& of() { return *tuned_declaration(TunedOp::rasterize_forward, Flavour::cpu); }
  static TunedShape shape() { return class_of(of(), {TunedOp::rasterize_forward, {16, 16 * 40}}); }
  static TunedValues set(long batch) { return {&of(), {batch}}; }
  static TunedShape another() { return {TunedOp::gemm, {64, 8, 8, 1}}; }
  static TunedValues of_another() { return all_values(*tuned_declaration(TunedOp::gemm, Flavour::cpu)).back(); }

  Context& ctx() { return test::context(Flavour::cpu); }
  TuningSubject subject() { return tuning_subject(ctx().device(), Flavour::cpu); }
  std::string path() { return tuning_path(subject()); }

  static TunedTrial trial(const TunedShape& shape, const TunedValues& values, const std::string& verdict) {
    TunedTrial out;
    out.shape = shape, out.values = values, out.verdict = verdict;
    return out;
  }
  void write(const std::vector<TunedTrial>& trials, const Tuning& choice = {}) {
    TuningTable table;
    table.of = subject();
    table.measured = "2026-11-23";
    table.trials = trials;
    table.choice = choice;
    write_tuning(path(), table);
  }
  TuningTable read() { return read_tuning(path()); }
  std::string verdict(const TunedValues& values) {
    for (const TunedTrial& t : read().trials)
      if (t.shape == shape() && t.values == values) return t.verdict;
    return "none";
  }

  static TuneRequest request() {
    TuneRequest out;
    out.shapes[shape()] = {shape(), 1};
    return out;
  }
  // The status that the search ends with.
  static Status status_of(Context& ctx, const TuneRequest& request) {
    try {
      tune(ctx, request);
    } catch (const Error& e) {
      return e.status();
    }
    return Status::ok;
  }

  const test::TemporaryFolder folder_;
  const test::Variable cache_{"VSPLAT_CACHE_DIR", folder_ / "cache"};
};

TEST_F(SearchTable, EachChoiceIsKeptByItsHash) {
  for (const long batch : {32L, 128L}) {
    TriedTable table(subject(), "");
    EXPECT_EQ(table.before(), batch == 32 ? "" : table.table().choice.hash());
    table.choose(shape(), set(batch));
    EXPECT_EQ(read().choice.chosen().at(shape()), set(batch));
    EXPECT_EQ(read_tuning(stored_tuning_path(read().choice.hash())).choice.chosen(), read().choice.chosen());
  }
}

TEST_F(SearchTable, WhatHasWonIsChosenWhenItHasBeatenTheDefault) {
  write({trial(shape(), set(64), "default"), trial(shape(), set(32), "best"), trial(shape(), set(128), "slower")});
  TuneRequest asked = request();
  asked.progress = [&](const std::string&, double) {
    EXPECT_EQ(read().choice.hash(), "") << "chosen before it was confirmed";
    return true;
  };
  EXPECT_EQ(tune(ctx(), asked).tried, 0);
  const std::string hash = read().choice.hash();
  EXPECT_EQ(verdict(set(32)), hash.empty() ? "slower" : "best");
  EXPECT_TRUE(hash.empty() || std::filesystem::exists(stored_tuning_path(hash)));
}

TEST_F(SearchTable, WhatIsTriedAgainIsNotLostBeforeAnotherHasWon) {
  Tuning choice;
  choice.set(another(), of_another());
  choice.set(shape(), set(32));
  write({trial(another(), of_another(), "best"), trial(shape(), set(64), "default"), trial(shape(), set(32), "best")},
        choice);
  TuneRequest asked = request();
  asked.again = true;
  asked.progress = [](const std::string& what, double) { return what.find("batch=64") != std::string::npos; };
  EXPECT_EQ(status_of(ctx(), asked), Status::cancelled);
  EXPECT_EQ(read().choice.chosen(), choice.chosen());
  EXPECT_EQ(verdict(set(64)), "default");
  EXPECT_EQ(verdict(set(32)), "none");
  EXPECT_EQ(read().trials.front().shape, another());
  // And it is reported, although it was not timed.
  asked.seconds = 1e-9;
  const TuneResult result = tune(ctx(), asked);
  EXPECT_EQ(result.left, 3);
  EXPECT_EQ(result.table.choice.chosen(), choice.chosen());
  const auto written = nlohmann::json::parse(tune_json(ctx(), result));
  ASSERT_EQ(written["chosen"].size(), 2u);
  EXPECT_TRUE(written["chosen"][1]["times_as_fast"].is_null());
}

TEST_F(SearchTable, IsThereThoughTheTimeWasTooShortToTryAnything) {
  TuneRequest asked = request();
  asked.seconds = 1e-9;
  const TuneResult result = tune(ctx(), asked);
  EXPECT_EQ(result.tried, 0);
  EXPECT_GT(result.left, 0);
  EXPECT_EQ(result.path, path());
  EXPECT_TRUE(read().trials.empty());
  EXPECT_EQ(read().of, subject());
}

TEST_F(SearchTable, NothingIsChosenThatHasWonNoRace) {
  write({trial(shape(), set(64), "begun again")});
  TuneRequest asked = request();
  asked.progress = [](const std::string& what, double) { return what.find("batch=128") == std::string::npos; };
  EXPECT_EQ(status_of(ctx(), asked), Status::cancelled);
  EXPECT_EQ(verdict(set(64)), "failed");
  EXPECT_EQ(verdict(set(32)), "right");
  EXPECT_EQ(read().choice.hash(), "");
  asked.progress = nullptr;
  const TuneResult result = tune(ctx(), asked);
  EXPECT_EQ(result.tried, 1);
  EXPECT_TRUE(result.not_right.empty());
  ASSERT_EQ(read().choice.chosen().count(shape()), 1u);
  const TunedValues best = read().choice.chosen().at(shape()), other = set(best == set(32) ? 128 : 32);
  EXPECT_EQ(verdict(best), "best");
  EXPECT_EQ(verdict(other), "slower");
}

TEST_F(SearchTable, AChoiceThatEndsTheProcessIsTakenOut) {
  Tuning choice;
  choice.set(shape(), set(128));
  write({trial(shape(), set(64), "default"), trial(shape(), set(128), "begun again")}, choice);
  TuneRequest asked = request();
  asked.progress = [](const std::string& what, double) { return what.find("batch=32") == std::string::npos; };
  EXPECT_EQ(status_of(ctx(), asked), Status::cancelled);
  EXPECT_EQ(verdict(set(128)), "failed");
  EXPECT_EQ(read().choice.hash(), "");
}

// A lack of memory is no result: the set is neither right nor wrong.
TEST_F(SearchTable, WantOfMemoryIsNoVerdict) {
  ContextOptions little;
  little.max_memory_gib = 1e-4;
  const auto small = test::open_context(Flavour::cpu, little);
  const TuneResult none = tune(*small, request());
  EXPECT_EQ(none.tried, 0);
  EXPECT_GE(none.left, 3);
  EXPECT_TRUE(none.not_right.empty());
  EXPECT_TRUE(none.table.trials.empty());
  const TuneResult result = tune(ctx(), request());
  EXPECT_EQ(result.tried, 3);
  EXPECT_EQ(result.left, 0);
}

TEST_F(SearchTable, WhatStopsTheDeviceStopsASearch) {
  TuneRequest asked = request();
  int calls = 0;
  asked.progress = [&](const std::string&, double) {
    ctx().cancel();
    return ++calls > 0;
  };
  EXPECT_EQ(status_of(ctx(), asked), Status::cancelled);
  ctx().go_on();
  EXPECT_EQ(calls, 1);
  EXPECT_TRUE(read().trials.empty()) << read().trials.front().verdict;
}

TEST_F(SearchTable, OneSearchWritesANamedTable) {
  TuneRequest asked = request();
  asked.path = folder_.path("named/t.json");
  Status of_second = Status::ok;
  asked.progress = [&](const std::string&, double) {
    TuneRequest second = request();
    second.path = asked.path;
    of_second = status_of(ctx(), second);
    return false;
  };
  EXPECT_EQ(status_of(ctx(), asked), Status::cancelled);
  EXPECT_EQ(of_second, Status::file);
  EXPECT_FALSE(std::filesystem::exists(folder_.path("named/.t.json.search")));
}

TEST_F(SearchTable, WhatIsNoNumberHasWords) {
  TunedTrial wrong = trial(shape(), set(32), "wrong");
  wrong.error = INFINITY, wrong.why = "some values are no numbers";
  write({wrong, trial(shape(), set(128), "failed")});
  TuneResult result;
  result.table = read();
  EXPECT_TRUE(std::isinf(result.table.trials[0].error));
  const auto written = nlohmann::json::parse(tune_json(ctx(), result));
  ASSERT_EQ(written["refused"].size(), 2u);
  EXPECT_TRUE(written["refused"][0]["error"].is_null());
  EXPECT_EQ(written["refused"][0]["why"], "some values are no numbers");
  EXPECT_TRUE(written["refused"][1]["why"].is_null());
}

}  // namespace
}  // namespace vsplat
