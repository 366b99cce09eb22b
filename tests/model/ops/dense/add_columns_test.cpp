#include "model/ops/dense/add_columns.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class AddColumnsOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(AddColumnsOp);
VSPLAT_OPERATION(AddColumnsOp, add_columns)

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
