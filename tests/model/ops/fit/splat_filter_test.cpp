#include "model/ops/fit/splat_filter.h"

#include "runtime/fail.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SplatFilter : public test::FlavourTest {};
VSPLAT_FLAVOURS(SplatFilter);
VSPLAT_OPERATION(SplatFilter, splat_filter)

TEST_P(SplatFilter, RejectsBadShape) {
  const Tensor four = ctx().tensor({4}), rows = ctx().tensor({4, 3}), five = ctx().tensor({5});
  EXPECT_THROW(splat_filter_variances(ctx(), {rows, ctx().tensor({2, 31}), four}), Error);
  EXPECT_THROW(splat_filter_variances(ctx(), {rows, ctx().tensor({2, 32}), five}), Error);
  EXPECT_THROW(splat_filter_forward(ctx(), {four, rows, five}), Error);
  EXPECT_THROW(splat_filter_backward(ctx(), {four, rows, five, rows, four}), Error);
}

}  // namespace
}  // namespace vsplat
