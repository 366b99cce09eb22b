#include "model/ops/networks/position_encoding.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/position_encoding.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class PositionEncoding : public test::FlavourTest {};
VSPLAT_FLAVOURS(PositionEncoding);
VSPLAT_OPERATION(PositionEncoding, position_encoding)

TEST(PositionEncodingReference, GradientsAreDifferences) {
  const std::vector<float> dout = test::random_floats(63 * 5, 67);
  std::vector<double> points = test::random_doubles(15, 62, -0.6f, 0.6f);
  const auto want =
      ref::central_differences(points, 1e-6, [&] { return ref::weighed(ref::position_encoding(points), dout); });
  EXPECT_TRUE(test::close(ref::position_encoding_backward(points, dout), want, 1e-6));
}

TEST_P(PositionEncoding, RejectsBadShape) {
  const Tensor points = ctx().tensor({2, 3});
  EXPECT_THROW(position_encoding_forward(ctx(), {points, ctx().tensor({2, 63}), 1}), Error);
  EXPECT_THROW(position_encoding_backward(ctx(), {points, ctx().tensor({2, 63}), ctx().tensor({2, 3}), 1}), Error);
  EXPECT_THROW(position_encoding_backward(ctx(), {points, ctx().tensor({2, 63}), ctx().tensor({1, 3})}), Error);
}

}  // namespace
}  // namespace vsplat
