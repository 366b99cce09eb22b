#include "model/ops/dense/add_columns.h"

#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class AddColumnsOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(AddColumnsOp);

// One rounding each: the bits are known.
TEST_P(AddColumnsOp, AddsToItsColumnsAndNoOthers) {
  for (const long r : {0L, 1L, 3L, 7L, 101L})
    for (const long c : {1L, 3L, 16L, 31L, 32L, 33L, 65L})
      for (const auto& [before, after] : {std::pair{0L, 0L}, {0L, 5L}, {c, 0L}, {2L, 3L}}) {
        const long w = before + c + after;
        const std::vector<float> x = test::random_floats(static_cast<std::size_t>(r * c), 1);
        std::vector<float> want = test::random_floats(static_cast<std::size_t>(r * w), 2);
        const Tensor out = ctx().upload({r, w}, want);
        for (long i = 0; i < r * c; ++i)
          want[static_cast<std::size_t>((i / c) * w + before + i % c)] += x[static_cast<std::size_t>(i)];
        add_columns(ctx(), {ctx().upload({r, c}, x), out, before});
        EXPECT_EQ(ctx().read<float>(out), want) << r << " x " << c << " to " << w << " from " << before;
      }
}

TEST_P(AddColumnsOp, SomeColumnsOfWhatIsAdded) {
  const long r = 7;
  for (const auto& [from, count, more] : {std::tuple{0L, 3L, 2L}, {2L, -1L, 0L}, {33L, 5L, 1L}}) {
    const long c = count < 0 ? 4 : count, width = from + c + more, w = c + 1;
    const std::vector<float> x = test::random_floats(static_cast<std::size_t>(r * width), 1);
    std::vector<float> want = test::random_floats(static_cast<std::size_t>(r * w), 2);
    const Tensor out = ctx().upload({r, w}, want);
    for (long i = 0; i < r * c; ++i)
      want[static_cast<std::size_t>(i / c * w + 1 + i % c)] +=
          x[static_cast<std::size_t>(i / c * width + from + i % c)];
    add_columns(ctx(), {ctx().upload({r, width}, x), out, 1, from, count});
    EXPECT_EQ(ctx().read<float>(out), want) << from;
  }
  EXPECT_THROW(add_columns(ctx(), {ctx().tensor({4, 3}), ctx().tensor({4, 3}), 0, 2, 2}), Error);
}

TEST_P(AddColumnsOp, RejectsBadShape) {
  const Tensor x = ctx().tensor({4, 3});
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({5, 3}), 0}), Error);
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({4, 3}), 1}), Error);
  EXPECT_THROW(add_columns(ctx(), {x, ctx().tensor({4, 5}), -1}), Error);
  EXPECT_THROW(add_columns(ctx(), {x.reshaped({12}), ctx().tensor({4, 5}), 0}), Error);
}

}  // namespace
}  // namespace vsplat
