#include "model/ops/dense/conv3d_up.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Conv3dUp : public test::FlavourTest {};
VSPLAT_FLAVOURS(Conv3dUp);
VSPLAT_OPERATION(Conv3dUp, conv3d_up)

TEST_P(Conv3dUp, RejectsBadShape) {
  const PackedMatrix packed = pack_conv3d_up(ctx(), ctx().upload({4, 3, 2, 2, 2}, std::vector<float>(96)), "w");
  Conv3dUpForward f;
  f.in = ctx().tensor({8, 4});
  f.x = f.y = f.z = 2;
  f.weights = &packed;
  f.out = ctx().tensor({64, 4});
  EXPECT_THROW(conv3d_up_forward(ctx(), f), Error) << "room for 4 channels of 3";
  f.out = ctx().tensor({8, 3});
  EXPECT_THROW(conv3d_up_forward(ctx(), f), Error);
}

}  // namespace
}  // namespace vsplat
