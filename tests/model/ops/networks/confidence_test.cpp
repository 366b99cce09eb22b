#include "model/ops/networks/confidence.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Confidence : public test::FlavourTest {};
VSPLAT_FLAVOURS(Confidence);
VSPLAT_OPERATION(Confidence, confidence)

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
