#include "model/ops/dense/transpose.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class TransposeTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(TransposeTest);
VSPLAT_OPERATION(TransposeTest, transpose)

TEST_P(TransposeTest, RejectsBadShape) {
  EXPECT_THROW(transpose(ctx(), {ctx().tensor({2, 3}), ctx().tensor({2, 3})}), Error);
}

}  // namespace
}  // namespace vsplat
