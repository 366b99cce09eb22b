#include "model/ops/fit/depth_loss.h"

#include <algorithm>
#include <limits>

#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class DepthLossOp : public test::FlavourTest {
 protected:
  static constexpr long kHeight = 5, kWidth = 7;
  static constexpr std::size_t kCount = 35;

  // Depths from 1 to 4, drawn through different alphas.
  DepthLossOp() {
    const auto random = test::random_floats(2 * kCount, 5, 0, 1);
    for (std::size_t i = 0; i < kCount; ++i) {
      expected_.push_back(1 + 3 * random[2 * i]);
      alpha_.push_back(0.2f + 0.8f * random[2 * i + 1]);
    }
  }

  struct Slopes {
    std::vector<float> ddepth, dalpha;
  };
  Slopes run(const std::vector<float>& given, DepthKind kind) {
    std::vector<float> depth(kCount);
    for (std::size_t i = 0; i < kCount; ++i) depth[i] = expected_[i] * alpha_[i];
    DepthLoss a = arguments(given, kind);
    a.drawn.depth = ctx().upload({kHeight, kWidth}, depth);
    depth_loss(ctx(), a);
    return {ctx().read<float>(a.ddepth), ctx().read<float>(a.dalpha)};
  }

  DepthLoss arguments(const std::vector<float>& given, DepthKind kind) {
    DepthLoss a;
    a.drawn.depth = ctx().tensor({kHeight, kWidth});
    a.drawn.alpha = ctx().upload({kHeight, kWidth}, alpha_);
    a.given = ctx().upload({kHeight, kWidth}, given);
    a.kind = kind, a.weight = 0.5f, a.known = kCount;
    a.ddepth = ctx().upload({kHeight, kWidth}, test::nans(kCount));
    a.dalpha = ctx().upload({kHeight, kWidth}, std::vector<float>(kCount, 0.25f));
    return a;
  }

  std::vector<float> expected_, alpha_;
};
VSPLAT_FLAVOURS(DepthLossOp);
VSPLAT_OPERATION(DepthLossOp, depth_loss)

// Depths that differ in their scale and shift alone have the same slopes.
TEST_P(DepthLossOp, AnUnknownScaleAndShiftDoNotMatter) {
  std::vector<float> want = expected_;
  for (std::size_t i = 0; i < kCount; ++i) want[i] *= i % 2 == 0 ? 1.1f : 0.9f;
  const Slopes plain = run(want, DepthKind::relative);
  EXPECT_EQ(std::count(plain.ddepth.begin(), plain.ddepth.end(), 0.0f), 0);
  for (const auto& [scale, shift] : {std::pair(0.1f, 0.2f), {0.05f, 0.0f}}) {
    std::vector<float> given = want;
    for (float& v : given) v = scale * v + shift;
    EXPECT_EQ(run(given, DepthKind::relative).ddepth, plain.ddepth);
  }
  std::vector<float> inverse = want, other;
  for (float& v : inverse) v = 1 / v;
  for (const float v : inverse) other.push_back(0.5f * v + 0.3f);
  const Slopes of_inverse = run(inverse, DepthKind::inverse);
  EXPECT_EQ(std::count(of_inverse.ddepth.begin(), of_inverse.ddepth.end(), 0.0f), 0);
  EXPECT_EQ(run(other, DepthKind::inverse).ddepth, of_inverse.ddepth);
}

TEST_P(DepthLossOp, UnknownOrImpossibleDepthsDoNotPull) {
  const std::vector<float> none(kCount, 0.0f), before(kCount, 0.25f);
  for (const DepthKind kind : {DepthKind::metric, DepthKind::relative, DepthKind::inverse}) {
    const Slopes slopes = run(none, kind);
    EXPECT_EQ(slopes.ddepth, none);
    EXPECT_EQ(slopes.dalpha, before);
  }
  std::vector<float> constant(kCount, 0.5f), opposite = expected_;
  for (float& v : opposite) v = 1 - 0.2f * v;
  for (const auto& given : {constant, opposite}) EXPECT_EQ(run(given, DepthKind::relative).ddepth, none);
  // Exactly right: neither nearer nor farther.
  expected_.assign(kCount, 2), alpha_.assign(kCount, 0.5f);
  EXPECT_EQ(run(std::vector<float>(kCount, 2.0f), DepthKind::metric).ddepth, none);
  // Nothing is drawn.
  alpha_.assign(kCount, 0.0f);
  EXPECT_EQ(run(constant, DepthKind::metric).ddepth, none);
}

TEST_P(DepthLossOp, RejectsWhatDoesNotFit) {
  const auto refused = [&](const auto& change) {
    DepthLoss a = arguments(expected_, DepthKind::metric);
    change(a);
    EXPECT_THROW(depth_loss(ctx(), a), Error);
  };
  refused([&](DepthLoss& a) { a.given = ctx().tensor({kWidth, kHeight}); });
  refused([&](DepthLoss& a) { a.given = {}; });
  refused([&](DepthLoss& a) { a.drawn.depth = {}; });
  refused([&](DepthLoss& a) { a.ddepth = ctx().tensor({kHeight, kWidth, 1}); });
  refused([&](DepthLoss& a) { a.dalpha = {}; });
}

}  // namespace
}  // namespace vsplat
