#include "model/ops/networks/plucker.h"

#include "tests/support/operation.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

class Plucker : public test::FlavourTest {};
VSPLAT_FLAVOURS(Plucker);
VSPLAT_OPERATION(Plucker, plucker)

TEST_P(Plucker, RejectsBadShape) {
  PluckerForward a;
  a.cameras = upload_cameras(ctx(), test::orbit(2, 16));
  a.patch = 8;
  a.out = ctx().tensor({3, 2, 2, 32});
  EXPECT_THROW(plucker_forward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
