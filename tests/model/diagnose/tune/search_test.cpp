// Every parameter set that a search may choose computes correct results.
#include "model/diagnose/tune/search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "model/diagnose/tune/check_chosen.h"
#include "model/diagnose/tune/sample.h"
#include "model/diagnose/tune/tune_case.h"
#include "runtime/files/folder_lock.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using test::context;

class TunedSets : public ::testing::TestWithParam<const TunedDeclaration*> {};
class EveryTunedSet : public TunedSets {};

// Shapes tried besides an odd one: a few tiles, with remainders.
std::vector<TunedShape> shapes_of(TunedOp op) {
  switch (op) {
    case TunedOp::gemm:
      return {{op, {300, 140, 96, 1}}, {op, {260, 33, 27 * 8, 27}}};
    case TunedOp::gemm_transposed:
      return {{op, {2100, 130, 70}}};
    case TunedOp::conv3d:
    case TunedOp::conv3d_winograd:
    case TunedOp::conv3d_weights:
      return {{op, {10 * 10 * 10, 40, 36}}};
    case TunedOp::conv3d_method:
      return {{op, {32, 32}}};
    case TunedOp::attention_forward:
    case TunedOp::attention_backward:
      return {{op, {2, 165, 48}}, {op, {1, 70, 80}}};
    case TunedOp::radix_sort:
      return {{op, {70001, 17}}, {op, {3000, 45}}};
    case TunedOp::rasterize_forward:
      return {{op, {25, 25 * 150}}};
  }
  return {};
}

void expect_right(const TunedDeclaration& of, const std::vector<TunedValues>& sets) {
  for (const TunedShape& shape : shapes_of(of.op))
    for (const TunedValues& values : sets)
      EXPECT_LE(error_of(context(of.flavour), shape, values), 1) << text_of(of, shape) << ", " << text_of(values);
}

// The smallest number of sets that contain each value of each parameter; the declaration's order determines the
// combinations.
std::vector<TunedValues> sets_with_each_value(const TunedDeclaration& of) {
  std::size_t most = 0;
  for (const TunedParameter& p : of.parameters) most = std::max(most, p.values.size());
  std::vector<TunedValues> out(most, default_values(of));
  for (std::size_t i = 0; i < most; ++i)
    for (std::size_t p = 0; p < of.parameters.size(); ++p)
      out[i].values[p] = of.parameters[p].values[i % of.parameters[p].values.size()];
  return out;
}

TEST_P(TunedSets, EachValueIsRight) { expect_right(*GetParam(), sets_with_each_value(*GetParam())); }
TEST_P(EveryTunedSet, IsRight) { expect_right(*GetParam(), all_values(*GetParam())); }

std::vector<const TunedDeclaration*> declared() {
  std::vector<const TunedDeclaration*> out;
  for (const TunedDeclaration& one : tuned_declarations()) out.push_back(&one);
  return out;
}

std::string name_of_case(const ::testing::TestParamInfo<const TunedDeclaration*>& info) {
  return std::string(info.param->name) + "_" + name_of(info.param->flavour);
}

INSTANTIATE_TEST_SUITE_P(Declared, TunedSets, ::testing::ValuesIn(declared()), name_of_case);
INSTANTIATE_TEST_SUITE_P(Slow, EveryTunedSet, ::testing::ValuesIn(declared()), name_of_case);

TEST(WorstError, OneThatIsNoNumberIsNotForgotten) {
  tuning::WorstError worst;
  for (int i = 0; i < 299; ++i) worst.add(i == 150 ? NAN : 1.5, 1);
  EXPECT_TRUE(std::isinf(worst.of_largest()));
  worst.add(1, 1);
  EXPECT_TRUE(std::isinf(worst.of_largest()));
}

// The error if the last element of an output, which every sample includes, is changed.
double error_with_last(Context& ctx, TuneCase& of, const Tensor& out, float last) {
  std::vector<unsigned char> bytes(out.bytes());
  ctx.read(out, bytes.data());
  std::vector<unsigned char> spoilt = bytes;
  float before = 0;
  std::memcpy(&before, &spoilt[spoilt.size() - sizeof before], sizeof before);
  const float now = before + last;
  std::memcpy(&spoilt[spoilt.size() - sizeof now], &now, sizeof now);
  ctx.write(out, spoilt.data());
  const double error = of.error(ctx);
  ctx.write(out, bytes.data());
  return error;
}

// The check detects errors: one wrong number, one NaN, and no output at all.
TEST(TuneCase, FindsWhatIsWrong) {
  for (const TunedDeclaration& of : tuned_declarations()) {
    Context& ctx = context(of.flavour);
    const auto one = tune_case(ctx, shapes_of(of.op).front());
    const auto run = one->ready(ctx);
    one->spoil(ctx);
    run();
    EXPECT_LE(one->error(ctx), one->tolerance()) << of.name;
    for (const Tensor& out : one->outputs()) {
      EXPECT_GT(error_with_last(ctx, *one, out, 1), one->tolerance()) << of.name;
      EXPECT_GT(error_with_last(ctx, *one, out, NAN), one->tolerance()) << of.name;
    }
    EXPECT_LE(one->error(ctx), one->tolerance()) << of.name;
    one->spoil(ctx);
    EXPECT_GT(one->error(ctx), one->tolerance()) << of.name;
  }
}

// A choice that is wrong on this driver is reported and removed from the table; the rest stays.
TEST(CheckChosen, TellsAndRefuses) {
  const test::TemporaryFolder folder;
  const test::Variable cache("VSPLAT_CACHE_DIR", folder / "cache");
  const auto ctx = test::open_context(Flavour::gpu);
  const TunedDeclaration& of = *tuned_declaration(TunedOp::gemm, Flavour::gpu);
  TuningTable table;
  table.of = tuning_subject(ctx->device(), Flavour::gpu);
  table.measured = "2026-11-23";
  for (const long n : {33L, 70L}) table.choice.set({TunedOp::gemm, {4000, n, 40, 1}}, all_values(of).back());
  const std::string path = tuning_path(table.of);
  write_tuning(path, table);
  ctx->use_tuning(std::make_shared<const Tuning>(table.choice));
  std::vector<CheckedChoice> checked = check_chosen(*ctx);
  ASSERT_EQ(checked.size(), 2u);
  for (const CheckedChoice& one : checked) {
    EXPECT_TRUE(one.right()) << one.name << " " << one.error << " " << one.why;
    EXPECT_GT(one.error, 0);
  }
  EXPECT_EQ(checked[0].name, "gemm m=4096 n=33 k=40 taps=1, tile=128 unroll=8 split=8");
  checked[1].error = 7;
  {  // while a search writes it
    const FolderLock searching(folder.path("cache/tuning"));
    EXPECT_EQ(refuse_chosen(*ctx, {checked[1]}), 0);
    EXPECT_EQ(read_tuning(path).choice.hash(), table.choice.hash());
  }
  EXPECT_EQ(refuse_chosen(*ctx, {checked[1]}), 1);
  const TuningTable now = read_tuning(path);
  ASSERT_EQ(now.choice.chosen().size(), 1u);
  EXPECT_EQ(now.choice.chosen().begin()->first.sizes[1], 33);
  EXPECT_EQ(refuse_chosen(*ctx, {checked[1]}), 0);
}

// A lack of memory says nothing about a table's choices.
TEST(CheckChosen, NeedsMemory) {
  ContextOptions little;
  little.max_memory_gib = 1e-5;
  const auto ctx = test::open_context(Flavour::gpu, little);
  Tuning choice;
  choice.set({TunedOp::gemm, {4000, 33, 40, 1}}, all_values(*tuned_declaration(TunedOp::gemm, Flavour::gpu)).back());
  ctx->use_tuning(std::make_shared<const Tuning>(choice));
  test::expect_error(Status::memory, {}, [&] { check_chosen(*ctx); });
}

}  // namespace
}  // namespace vsplat
