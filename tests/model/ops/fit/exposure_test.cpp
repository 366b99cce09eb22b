#include "model/ops/fit/exposure.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ExposureOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(ExposureOp);
VSPLAT_OPERATION(ExposureOp, exposure)

TEST_P(ExposureOp, TheMapThatIsNoneChangesNothing) {
  const auto colour = test::random_floats(30, 1, 0, 1), alpha = test::random_floats(10, 2, 0, 1);
  const DevicePicture drawn{ctx().upload({2, 5, 3}, colour), ctx().upload({2, 5}, alpha), {}};
  const Tensor map = ctx().upload({12}, std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const Tensor out = ctx().upload({2, 5, 3}, test::nans(30));
  exposure_forward(ctx(), {map, drawn, selftest::kBehindPictures, out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), colour, 1e-6));
}

}  // namespace
}  // namespace vsplat
