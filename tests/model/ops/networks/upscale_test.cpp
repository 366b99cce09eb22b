#include "model/ops/networks/upscale.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Upscale : public test::FlavourTest {};
VSPLAT_FLAVOURS(Upscale);
VSPLAT_OPERATION(Upscale, upscale)

TEST_P(Upscale, NoPoints) {
  const Tensor none = ctx().tensor({0, 3}), wide = ctx().tensor({0, 11});
  upscale_forward(ctx(), {ctx().tensor({0, 6}), none, ctx().tensor({0, 5}), 1, 1, 1, none, none, wide});
  upscale_backward(ctx(),
                   {ctx().tensor({0, 6}), 1, 1, 1, none, wide, ctx().tensor({0, 6}), none, ctx().tensor({0, 5})});
}

TEST_P(Upscale, RejectsBadShape) {
  const Tensor raw = ctx().tensor({2, 6}), points = ctx().tensor({2, 3}), feature = ctx().tensor({2, 5}),
               children = ctx().tensor({4, 3}), wide = ctx().tensor({4, 11});
  EXPECT_THROW(upscale_forward(ctx(), {raw, points, feature, 2, 1, 1, children, children, wide}), Error);
  EXPECT_THROW(upscale_forward(ctx(), {raw, points, feature, 1, 1, 1, points, children, wide}), Error);
  EXPECT_THROW(upscale_forward(ctx(), {ctx().tensor({2, 5}), points, feature, 1, 1, 1, children, children, wide}),
               Error);
  EXPECT_THROW(upscale_backward(ctx(), {raw, 1, 1, 1, children, wide, raw, children, feature}), Error);
}

}  // namespace
}  // namespace vsplat
