#include "model/ops/volume/top_k.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class TopKTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(TopKTest);
VSPLAT_OPERATION(TopKTest, top_k)

TEST_P(TopKTest, RejectsBadShape) {
  const Tensor x = ctx().tensor({4}), flags = ctx().tensor({4}, Type::u32);
  EXPECT_THROW(top_k(ctx(), {x, 2, ctx().tensor({5}, Type::u32), {}}), Error);
  EXPECT_THROW(top_k(ctx(), {x, -1, flags, {}}), Error);
  EXPECT_THROW(top_k(ctx(), {x, 2, flags, x}), Error);
}

}  // namespace
}  // namespace vsplat
