#include "runtime/side_by_side.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "runtime/arena.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

class SideBySideTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(SideBySideTest);

const std::vector<Shape> kShapes = {{3}, {0}, {5, 7}, {64}, {1}, {2, 3, 5}};

TEST_P(SideBySideTest, PartsAreTheWholesMemoryAndNotEachOthers) {
  const SideBySide all = side_by_side(ctx(), kShapes, "test");
  ASSERT_EQ(all.parts.size(), kShapes.size());
  std::vector<float> expected;
  for (std::size_t i = 0; i < kShapes.size(); ++i) {
    EXPECT_EQ(all.parts[i].shape(), kShapes[i]);
    const std::vector<float> zeros(static_cast<std::size_t>(all.parts[i].count()), 0.0f);
    EXPECT_EQ(ctx().read<float>(all.parts[i]), zeros);
    std::vector<float> values = zeros;
    for (float& v : values) v = static_cast<float>(expected.size() + 1), expected.push_back(v);
    ctx().write(all.parts[i], values.data());
  }
  std::vector<float> found;
  for (const float v : ctx().read<float>(all.whole))
    if (v != 0) found.push_back(v);
  EXPECT_EQ(found, expected) << "in order, and zeros between them";
  const std::size_t padding = all.whole.bytes() - expected.size() * sizeof(float);
  EXPECT_LE(padding, kShapes.size() * ctx().memory().limits().align);
}

TEST_P(SideBySideTest, ThePieceIsGivenBackWithItsLastPart) {
  const std::size_t before = ctx().memory().live();
  Tensor last;
  {
    const SideBySide all = side_by_side(ctx(), kShapes, "test");
    last = all.parts.back();
  }
  EXPECT_GT(ctx().memory().live(), before);
  EXPECT_EQ(ctx().read<float>(last), std::vector<float>(30, 0.0f));
  last = Tensor();
  EXPECT_EQ(ctx().memory().live(), before);
}

TEST_P(SideBySideTest, ASliceIsTheWholesMemory) {
  const auto rows = static_cast<long>(ctx().memory().limits().align);  // of two numbers each: any multiple of `align`
  std::vector<float> values(static_cast<std::size_t>(6 * rows));
  std::iota(values.begin(), values.end(), 0.0f);
  Tensor all = ctx().upload({3 * rows, 2}, values);
  const Tensor some = slice(all, rows, rows + 1);
  EXPECT_EQ(some.shape(), (Shape{rows + 1, 2}));
  EXPECT_EQ(ctx().read<float>(some), std::vector<float>(&values[2 * rows], &values[4 * rows + 2]));
  ctx().fill_zero(slice(all, 2 * rows, rows));
  std::fill(values.begin() + 4 * rows, values.end(), 0.0f);
  EXPECT_EQ(ctx().read<float>(all), values);
  all = Tensor();
  EXPECT_EQ(ctx().read<float>(some)[1], values[2 * rows + 1]) << "lives as long as the slice";
  test::expect_error(Status::internal, {"rows"}, [&] { slice(some, rows, 2); });
}

TEST_P(SideBySideTest, APlanTakesAsMuch) {
  const auto planner = ctx().planner();
  const std::size_t planned = planner->memory().live(), made = ctx().memory().live();
  const SideBySide plan = side_by_side(*planner, kShapes, "test"), run = side_by_side(ctx(), kShapes, "test");
  EXPECT_EQ(planner->memory().live() - planned, ctx().memory().live() - made);
}

TEST_P(SideBySideTest, SplitsWhereAPieceWouldBeTooLong) {
  const std::size_t align = ctx().memory().limits().align;
  const long unit = static_cast<long>(align / sizeof(float));
  const std::vector<Shape> shapes = {{unit}, {1}, {2 * unit}, {5 * unit}, {unit}, {unit}};
  EXPECT_EQ(split_to_fit(ctx(), shapes, 3 * align), (std::vector<std::size_t>{2, 1, 1, 2}));
  EXPECT_EQ(split_to_fit(ctx(), shapes, 1000 * align), (std::vector<std::size_t>{6}));
  EXPECT_TRUE(split_to_fit(ctx(), {}, align).empty());
}

}  // namespace
}  // namespace vsplat
