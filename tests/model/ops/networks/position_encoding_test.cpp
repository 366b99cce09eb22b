#include "model/ops/networks/position_encoding.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/position_encoding.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

std::vector<float> random_points(long p) {
  return test::random_floats(static_cast<std::size_t>(3 * p), 62, -0.6f, 0.6f);
}

// `rows` [P, 63] with `before` and `after` columns of `value` around them.
template <class T>
std::vector<T> widened(const std::vector<T>& rows, long before, long after, T value) {
  std::vector<T> out;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (i % 63 == 0) out.insert(out.end(), static_cast<std::size_t>(before), value);
    out.push_back(rows[i]);
    if (i % 63 == 62) out.insert(out.end(), static_cast<std::size_t>(after), value);
  }
  return out;
}

class PositionEncoding : public test::FlavourTest {};
VSPLAT_FLAVOURS(PositionEncoding);
VSPLAT_OPERATION(PositionEncoding, position_encoding)

TEST_P(PositionEncoding, MatchesReference) {
  for (const long p : {0L, 1L, 15L, 16L, 17L, 101L}) {
    const std::vector<float> points = random_points(p);
    const std::vector<double> want = widened(ref::position_encoding(points), 1, 0, 5.0);
    const Tensor out = ctx().upload({p, 64}, std::vector<float>(want.size(), 5.0f));
    position_encoding_forward(ctx(), {ctx().upload({p, 3}, points), out, 1});
    EXPECT_TRUE(test::close(ctx().read<float>(out), want, 1e-7)) << p;  // of the largest, 5
  }
}

TEST_P(PositionEncoding, BackwardMatchesReferenceAndAdds) {
  for (const long p : {0L, 1L, 15L, 16L, 17L, 101L}) {
    const std::vector<float> points = random_points(p);
    const std::vector<float> dout = test::random_floats(static_cast<std::size_t>(63 * p), 65);
    const std::vector<float> before = test::random_floats(static_cast<std::size_t>(3 * p), 66, -99.0f, 99.0f);
    std::vector<double> want = ref::position_encoding_backward(points, dout);
    for (std::size_t i = 0; i < want.size(); ++i) want[i] += before[i];
    const Tensor dpoints = ctx().upload({p, 3}, before);
    const Tensor wide = ctx().upload({p, 68}, widened(dout, 2, 3, std::numeric_limits<float>::quiet_NaN()));
    position_encoding_backward(ctx(), {ctx().upload({p, 3}, points), wide, dpoints, 2});
    EXPECT_TRUE(test::close(ctx().read<float>(dpoints), want, 1e-6)) << p;
  }
}

TEST(PositionEncodingReference, GradientsAreDifferences) {
  const std::vector<float> given = random_points(5), dout = test::random_floats(63 * 5, 67);
  std::vector<double> points(given.begin(), given.end());
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
