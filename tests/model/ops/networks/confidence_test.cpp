#include "model/ops/networks/confidence.h"

#include "model/diagnose/selftest/reference/confidence.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Confidence : public test::FlavourTest {
 protected:
  void check(long p, long c, bool softmax) {
    SCOPED_TRACE(std::to_string(p) + " x " + std::to_string(c) + (softmax ? " softmax" : " sigmoid"));
    const auto points = static_cast<std::size_t>(p), values = static_cast<std::size_t>(p * c);
    const auto logits = test::random_floats(points, 1, -3, 3), x = test::random_floats(values, 2),
               dy = test::random_floats(values, 3);
    const std::vector<double> exact(logits.begin(), logits.end());
    const Tensor confidence = ctx().upload({p}, test::nans(points));
    confidence_forward(ctx(), {ctx().upload({p}, logits), softmax, confidence});
    const std::vector<double> want = ref::confidence(exact, softmax);
    EXPECT_TRUE(test::close(ctx().read<float>(confidence), want, 1e-6));
    const Tensor by = ctx().upload({p, c}, dy), dlogits = ctx().upload({p}, test::nans(points));
    confidence_backward(ctx(), {ctx().upload({p, c}, x), confidence, softmax, by, by, dlogits});
    std::vector<double> dx;
    for (std::size_t i = 0; i < values; ++i) dx.push_back(dy[i] * want[i / static_cast<std::size_t>(c)]);
    EXPECT_TRUE(test::close(ctx().read<float>(by), dx, 1e-6));
    // (A softmax of one point is 1 whatever its logit is.)
    std::vector<double> by_logits = ref::confidence_backward(exact, softmax, x, dy);
    if (softmax && p == 1) by_logits = {0};
    EXPECT_TRUE(test::close(ctx().read<float>(dlogits), by_logits, 2e-5, softmax && p == 1));
  }
};
VSPLAT_FLAVOURS(Confidence);
VSPLAT_OPERATION(Confidence, confidence)

TEST_P(Confidence, MatchesReference) {
  for (const long p : {1L, 3L, 7L, 63L, 64L, 65L, 211L})
    for (const bool softmax : {false, true}) check(p, 5, softmax);
  check(7, 33, true);
}

// Logits whose exponentials no float holds.
TEST_P(Confidence, LargeLogits) {
  const std::vector<float> logits = {200, 199, -300, 200};
  const Tensor out = ctx().tensor({4});
  confidence_forward(ctx(), {ctx().upload({4}, logits), true, out});
  const double e = std::exp(-1.0);
  EXPECT_TRUE(test::close(ctx().read<float>(out), std::vector<double>{1 / (2 + e), e / (2 + e), 0, 1 / (2 + e)}, 1e-6));
}

TEST_P(Confidence, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0}), rows = ctx().tensor({0, 3});
  confidence_forward(ctx(), {none, true, none});
  confidence_backward(ctx(), {rows, none, true, rows, rows, none});
  EXPECT_THROW(confidence_forward(ctx(), {none, true, ctx().tensor({1})}), Error);
  EXPECT_THROW(confidence_backward(ctx(), {rows, none, true, rows, ctx().tensor({0, 4}), none}), Error);
}

}  // namespace
}  // namespace vsplat
