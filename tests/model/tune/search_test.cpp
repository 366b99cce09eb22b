// Whatever set of parameters a search may choose: what is computed with it is right.
#include "model/tune/search.h"

#include <gtest/gtest.h>

#include <random>

#include "model/tune/tune_case.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::context;

class TunedSets : public ::testing::TestWithParam<const TunedDeclaration*> {};

// What is tried beside an odd shape: of a few tiles, with tails.
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
  }
  return {};
}

TEST_P(TunedSets, EverySetIsRight) {
  const TunedDeclaration& of = *GetParam();
  std::vector<TunedValues> sets = all_values(of);
  std::shuffle(sets.begin() + 1, sets.end(), std::mt19937(7));
  sets.resize(std::min<std::size_t>(sets.size(), 20));
  for (const TunedShape& shape : shapes_of(of.op))
    for (const TunedValues& values : sets)
      EXPECT_LE(error_of(context(of.flavour), shape, values), 1) << text_of(of, shape) << ", " << text_of(values);
}

std::vector<const TunedDeclaration*> declared() {
  std::vector<const TunedDeclaration*> out;
  for (const TunedDeclaration& one : tuned_declarations()) out.push_back(&one);
  return out;
}

std::string name_of_case(const ::testing::TestParamInfo<const TunedDeclaration*>& info) {
  return std::string(info.param->name) + "_" + name_of(info.param->flavour);
}

INSTANTIATE_TEST_SUITE_P(Declared, TunedSets, ::testing::ValuesIn(declared()), name_of_case);

// The check would find an error: of the same numbers with one that is off.
TEST(TuneCase, FindsWhatIsWrong) {
  Context& ctx = context(Flavour::cpu);
  for (const TunedOp op : {TunedOp::gemm, TunedOp::attention_forward, TunedOp::attention_backward, TunedOp::conv3d,
                           TunedOp::gemm_transposed}) {
    const TunedShape shape = shapes_of(op).front();
    const auto one = tune_case(ctx, shape);
    const auto run = one->ready(ctx);
    run();
    EXPECT_LE(one->error(ctx), one->tolerance()) << static_cast<int>(op);
    one->spoil(ctx);
    EXPECT_FALSE(one->error(ctx) <= one->tolerance()) << static_cast<int>(op);
  }
}

}  // namespace
}  // namespace vsplat
