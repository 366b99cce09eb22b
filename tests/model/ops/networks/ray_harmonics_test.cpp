#include "model/ops/networks/ray_harmonics.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RayHarmonics : public test::FlavourTest {};
VSPLAT_FLAVOURS(RayHarmonics);
VSPLAT_OPERATION(RayHarmonics, ray_harmonics)

TEST_P(RayHarmonics, EmptyAndBadShape) {
  ray_harmonics_forward(ctx(), {ctx().tensor({0, 6}), ctx().tensor({0, 32})});
  EXPECT_THROW(ray_harmonics_forward(ctx(), {ctx().tensor({2, 6}), ctx().tensor({2, 16})}), Error);
  EXPECT_THROW(ray_harmonics_backward(ctx(), {ctx().tensor({2, 6}), ctx().tensor({3, 32}), ctx().tensor({2, 6})}),
               Error);
}

}  // namespace
}  // namespace vsplat
