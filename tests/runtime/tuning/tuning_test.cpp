#include "runtime/tuning/tuning.h"

#include <gtest/gtest.h>

#include <set>

#include "runtime/error.h"
#include "runtime/gemm.h"
#include "runtime/log.h"
#include "runtime/tuning/held_tuning.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using test::contents_of;
using test::put_file;
using test::TemporaryFolder;

const TunedDeclaration& gemm_of(Flavour flavour) { return *tuned_declaration(TunedOp::gemm, flavour); }

TunedValues with(const TunedDeclaration& of, const char* name, long value) {
  TunedValues out = default_values(of);
  for (std::size_t i = 0; i < of.parameters.size(); ++i)
    if (std::string(of.parameters[i].name) == name) out.values[i] = value;
  return out;
}

std::string message_of(const std::function<void()>& call) {
  try {
    call();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

TEST(TuningDeclarations, AreWhole) {
  std::set<std::pair<TunedOp, Flavour>> seen;
  for (const TunedDeclaration& one : tuned_declarations()) {
    EXPECT_TRUE(seen.insert({one.op, one.flavour}).second) << one.name;
    EXPECT_LT(static_cast<int>(one.op), kTunedOps) << one.name;
    EXPECT_LE(one.sizes.size(), 4u) << one.name;
    ASSERT_LE(one.parameters.size(), 4u) << one.name;
    std::size_t sets = 1;
    for (const TunedParameter& p : one.parameters) {
      EXPECT_GT(p.values.size(), 1u) << one.name << " " << p.name;
      EXPECT_EQ(std::set<long>(p.values.begin(), p.values.end()).size(), p.values.size()) << one.name << " " << p.name;
      sets *= p.values.size();
    }
    EXPECT_EQ(all_values(one).size(), sets) << one.name;
    EXPECT_EQ(all_values(one).front(), default_values(one)) << one.name;
    EXPECT_EQ(tuned_declaration(one.name, one.flavour), &one);
  }
}

TEST(TuningLookup, GoesByClass) {
  const TunedDeclaration& of = gemm_of(Flavour::gpu);
  Tuning tuning;
  EXPECT_EQ(tuning.hash(), "");
  EXPECT_EQ(tuning.values(Flavour::gpu, {TunedOp::gemm, {1000, 768, 768, 1}}), default_values(of));
  tuning.set({TunedOp::gemm, {1000, 768, 768, 1}}, with(of, "tile", 128));
  for (const long m : {513L, 1000L, 1024L})
    EXPECT_EQ(tuning.values(Flavour::gpu, {TunedOp::gemm, {m, 768, 768, 1}}).at("tile"), 128) << m;
  for (const long m : {512L, 1025L})
    EXPECT_EQ(tuning.values(Flavour::gpu, {TunedOp::gemm, {m, 768, 768, 1}}).at("tile"), 0) << m;
  EXPECT_EQ(tuning.values(Flavour::gpu, {TunedOp::gemm, {1000, 767, 768, 1}}).at("tile"), 0);
  EXPECT_EQ(tuning.values(Flavour::cpu, {TunedOp::gemm, {1000, 768, 768, 1}}).of, &gemm_of(Flavour::cpu));
  EXPECT_EQ(tuning.hash().size(), 64u);
  tuning.set({TunedOp::gemm, {1000, 768, 768, 1}}, default_values(of));  // as if it were not in the table
  EXPECT_EQ(tuning.hash(), "");
}

TEST(TuningLookup, IsNotedByAPlanner) {
  Context& ctx = test::context(Flavour::cpu);
  const auto planner = ctx.planner();
  NotedShapes noted;
  planner->collect(noted);
  const PackedMatrix b = pack_matrix(*planner, nullptr, 8, 5, 1, 8, "B");
  for (const long m : {33L, 60L, 40L}) {
    Gemm g;
    g.a.x0 = planner->tensor({m, 8});
    g.b = &b;
    g.out = planner->tensor({m, 5});
    gemm(*planner, g);
  }
  ASSERT_EQ(noted.size(), 1u);
  EXPECT_EQ(noted.begin()->first, (TunedShape{TunedOp::gemm, {64, 5, 8, 1}}));
  EXPECT_EQ(noted.begin()->second.largest, (TunedShape{TunedOp::gemm, {60, 5, 8, 1}}));
  EXPECT_EQ(noted.begin()->second.calls, 3);
}

TuningTable a_table(const Context& ctx) {
  TuningTable out;
  out.of = tuning_subject(ctx.device(), ctx.flavour());
  out.measured = "2026-11-23";
  const TunedDeclaration& of = gemm_of(ctx.flavour());
  const TunedShape shape = class_of(of, {TunedOp::gemm, {1000, 768, 768, 1}});
  TunedTrial trial;
  trial.shape = shape, trial.values = all_values(of).back(), trial.verdict = "best";
  trial.seconds = 0.5, trial.against = 1, trial.error = 1e-6;
  out.trials = {trial};
  out.choice.set(shape, trial.values);
  return out;
}

TEST(TuningTable, IsReadAsItWasWritten) {
  const TemporaryFolder folder;
  for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
    const TuningTable table = a_table(test::context(flavour));
    const std::string path = folder / "tables/a.json";
    write_tuning(path, table);
    const TuningTable read = read_tuning(path);
    EXPECT_EQ(read.of, table.of);
    EXPECT_EQ(read.measured, table.measured);
    EXPECT_EQ(read.choice.chosen(), table.choice.chosen());
    EXPECT_EQ(read.choice.hash(), table.choice.hash());
    ASSERT_EQ(read.trials.size(), 1u);
    EXPECT_EQ(read.trials[0].verdict, "best");
    EXPECT_EQ(read.trials[0].values, table.trials[0].values);
    EXPECT_EQ(read.trials[0].against, 1);
  }
}

TEST(TuningTable, WhatIsWrongIsNamed) {
  const TemporaryFolder folder;
  const std::string path = folder / "a.json";
  write_tuning(path, a_table(test::context(Flavour::gpu)));
  const std::string whole = contents_of(path);
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    const auto at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    put_file(path, text.replace(at, from.size(), to));
    return message_of([&] { read_tuning(path); });
  };
  const auto says = [&](const std::string& message, const std::string& words) {
    EXPECT_NE(message.find(words), std::string::npos) << message;
    EXPECT_NE(message.find(path), std::string::npos) << message;
  };
  says(changed("\"tile\": 128", "\"tile\": 96"), "chosen[0].set.tile is 96, one of 0, 64, 128 expected");
  says(changed("\"tile\": 128", "\"tile\": 64"), "hash");
  says(changed("\"m\": 1024", "\"m\": 1000"), "chosen[0].shape");
  says(changed("\"op\": \"gemm\"", "\"op\": \"fft\""), "chosen[0].op is fft");
  says(changed("\"version\": 1", "\"version\": 2"), "version is 2, 1 expected");
  says(changed("\"measured\": \"2026-11-23\"", "\"measured\": 7"), "measured is 7");
  says(changed("\"chosen\": [", "\"chosen\": 3, \"other\": ["), "chosen is 3");
  put_file(path, whole.substr(0, whole.size() / 2));
  says(message_of([&] { read_tuning(path); }), "no JSON object");
  says(message_of([&] { read_tuning(folder / "none.json"); }).replace(0, 0, path), "cannot be read");
}

TEST(TuningTable, IsTakenFromTheCacheOrTheEnvironment) {
  const TemporaryFolder folder;
  const test::Variable cache("VSPLAT_CACHE_DIR", folder / "cache");
  const Context& ctx = test::context(Flavour::gpu);
  const TuningTable table = a_table(ctx);
  const std::string hash = table.choice.hash();
  {
    const test::Variable unset("VSPLAT_TUNING", "");
    EXPECT_EQ(tuning_for(ctx.device(), Flavour::gpu)->hash(), "");
    write_tuning(tuning_path(table.of), table);
    EXPECT_EQ(tuning_for(ctx.device(), Flavour::gpu)->hash(), hash);
    EXPECT_EQ(tuning_for(ctx.device(), Flavour::cpu)->hash(), "");
    EXPECT_EQ(test::open_context(Flavour::gpu)->tuning().hash(), hash);
    const auto opened = test::open_context(Flavour::gpu);
    EXPECT_EQ(opened->stream()->tuning().hash(), hash);
    EXPECT_EQ(opened->planner()->tuned({TunedOp::gemm, {1000, 768, 768, 1}}), table.trials[0].values);
    std::filesystem::permissions(tuning_path(table.of), std::filesystem::perms::others_write,
                                 std::filesystem::perm_options::add);
    EXPECT_EQ(tuning_for(ctx.device(), Flavour::gpu)->hash(), "");  // other users may have written it
  }
  {
    const test::Variable off("VSPLAT_TUNING", "off");
    EXPECT_EQ(tuning_for(ctx.device(), Flavour::gpu)->hash(), "");
  }
  const std::string path = folder / "mine.json";
  write_tuning(path, table);
  const test::Variable named("VSPLAT_TUNING", path);
  EXPECT_EQ(tuning_for(ctx.device(), Flavour::gpu)->hash(), hash);
  const std::string other = message_of([&] { tuning_for(ctx.device(), Flavour::cpu); });
  EXPECT_NE(other.find(path + " (VSPLAT_TUNING) is a table for "), std::string::npos) << other;
  EXPECT_NE(other.find("cpu kernels"), std::string::npos) << other;
  EXPECT_NE(other.find("unset VSPLAT_TUNING"), std::string::npos) << other;
  put_file(path, "{}");
  const std::string broken = message_of([&] { tuning_for(ctx.device(), Flavour::gpu); });
  EXPECT_NE(broken.find("unset VSPLAT_TUNING"), std::string::npos) << broken;
}

// What a checkpoint records about the way its sums were computed.
TEST(HeldTuning, SaysWhatWasSwitchedOff) {
  SwitchedOff off;
  off.winograd = off.tuned = true;
  ContextOptions options;
  options.off = off;
  const auto without = test::open_context(Flavour::cpu, options);
  const Context& with_all = test::context(Flavour::cpu);
  std::map<std::string, std::string> all, less;
  hold_tuning(with_all, all);
  EXPECT_EQ(all.count("switched_off"), 0u);
  hold_tuning(*without, less);
  EXPECT_EQ(less["switched_off"], "Winograd's convolutions") << "what tables choose their hash tells";
  std::string said;
  set_log_sink([&](LogLevel level, const std::string& text) {
    if (level == LogLevel::warning) said += text;
  });
  refuse_other_tuning(with_all, all, "run");
  refuse_other_tuning(*without, less, "run");
  EXPECT_EQ(said, "");
  refuse_other_tuning(*without, all, "run");
  EXPECT_EQ(said.find("run: the bits of the results change"), 0u) << said;
  EXPECT_NE(said.find("had switched off nothing when it was begun, and Winograd's convolutions now"), std::string::npos)
      << said;
  said.clear();
  refuse_other_tuning(with_all, less, "run");
  EXPECT_NE(said.find("had switched off Winograd's convolutions when it was begun, and nothing now"), std::string::npos)
      << said;
  set_log_sink(nullptr);
}

// No context uses choices that a self-test has found wrong, whichever table has them; another choice for the same shape
// is used.
TEST(TuningTable, IsLeftWithoutWhatASelfTestRefused) {
  const TemporaryFolder folder;
  const test::Variable cache("VSPLAT_CACHE_DIR", folder / "cache"), selftest("VSPLAT_SELFTEST", "");
  const DeviceInfo device = test::context(Flavour::gpu).device();
  const TunedDeclaration& of = gemm_of(Flavour::gpu);
  const TunedShape wrong{TunedOp::gemm, {1024, 768, 768, 1}}, right{TunedOp::gemm, {1024, 96, 96, 1}};
  TuningTable table = a_table(test::context(Flavour::gpu));
  table.choice.set(right, all_values(of).back());
  ASSERT_EQ(table.choice.chosen().size(), 2u);
  const std::string hash = table.choice.hash(), name = name_of_choice(wrong, table.choice.chosen().at(wrong));
  EXPECT_EQ(name, "gpu gemm m=1024 n=768 k=768 taps=1, tile=128 unroll=8 split=8");
  Verdict verdict{Fitness::degraded, {}, "the tuned parameters of a product", "2026-11-23", {name}};
  verdict.off.tuned = true;
  ASSERT_TRUE(remember(device, verdict));
  EXPECT_EQ(refused_choices(device), std::vector<std::string>{name});
  const std::string named = folder / "named.json";
  for (const std::string& path : {tuning_path(table.of), named}) {
    write_tuning(path, table);
    const test::Variable tuning("VSPLAT_TUNING", path == named ? path : "");
    const auto ctx = test::open_context(Flavour::gpu);
    EXPECT_EQ(ctx->tuned(wrong), default_values(of));
    EXPECT_EQ(ctx->tuned(right), all_values(of).back());
    EXPECT_TRUE(ctx->switched_off().tuned);
    // A training that began with that table fails with an error that says so, and that the table must not be used.
    write_tuning(stored_tuning_path(hash), table);
    const std::string message = message_of([&] { refuse_other_tuning(*ctx, {{"tuning", hash}}, "run"); });
    for (const std::string& words : {hash.substr(0, 12), std::string("refused"), name})
      EXPECT_NE(message.find(words), std::string::npos) << message;
    const test::Variable ignored("VSPLAT_SELFTEST", "ignore");
    EXPECT_EQ(test::open_context(Flavour::gpu)->tuning().hash(), hash);
  }
  table.choice.set(wrong, with(of, "tile", 128));
  write_tuning(named, table);
  const test::Variable tuning("VSPLAT_TUNING", named);
  const auto ctx = test::open_context(Flavour::gpu);
  EXPECT_EQ(ctx->tuning().hash(), table.choice.hash());
  EXPECT_FALSE(ctx->switched_off().tuned);
}

}  // namespace
}  // namespace vsplat
