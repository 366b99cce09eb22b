#include "model/ops/fit/picture_target.h"

#include <algorithm>

#include "model/diagnose/selftest/inputs/given_pictures.h"
#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using selftest::GivenPicture;

class PictureTargetOp : public test::FlavourTest {
 protected:
  PictureTarget upload(const GivenPicture& p, long h, long w, float alpha_weight) {
    const auto count = static_cast<std::size_t>(h * w);
    PictureTarget a;
    a.given = ctx().upload({h, w, 4}, p.given, Type::u8);
    if (!p.known.empty()) a.known = ctx().upload({h, w}, p.known, Type::u8);
    a.background = selftest::kBehindPictures;
    a.drawn.colour = ctx().upload({h, w, 3}, p.colour), a.drawn.alpha = ctx().upload({h, w}, p.alpha);
    a.alpha_weight = alpha_weight;
    a.target = ctx().upload({h, w, 3}, test::nans(3 * count));
    a.dalpha = ctx().upload({h, w}, test::nans(count));
    return a;
  }
};
VSPLAT_FLAVOURS(PictureTargetOp);
VSPLAT_OPERATION(PictureTargetOp, picture_target)

// The gradient of what it says it is the gradient of: the mean over pixels, where they are known and off by more than
// half a step.
TEST_P(PictureTargetOp, AlphasSlopeIsThatOfTheMeanAbsoluteError) {
  const GivenPicture p = selftest::given_picture(9, 11);
  const PictureTarget a = upload(p, 9, 11, 0.5f);
  picture_target(ctx(), a);
  const auto got = ctx().read<float>(a.dalpha);
  const auto loss = [&](std::size_t i, double alpha) {
    return 0.5 * std::abs(alpha - p.given[4 * i + 3] / 255.0) / 99;
  };
  int counted = 0;
  for (std::size_t i = 0; i < 99; ++i) {
    const double alpha = p.alpha[i], off = std::abs(255 * alpha - p.given[4 * i + 3]);
    const bool counts = p.known[i] != 0 && off > 0.5;
    counted += counts;
    const double want = counts ? (loss(i, alpha + 1e-4) - loss(i, alpha - 1e-4)) / 2e-4 : 0;
    EXPECT_NEAR(got[i], want, 1e-8) << i;
  }
  EXPECT_GT(counted, 40);
  EXPECT_LT(counted, 90);
}

// Where nothing is known, no colour that can be drawn has a loss: the target is what was drawn to the bit, and no
// beyond of it pulls.
TEST_P(PictureTargetOp, UnknownPixelsAreAsDrawn) {
  GivenPicture p = selftest::given_picture(6, 7);
  std::fill(p.known.begin(), p.known.end(), std::uint8_t{0});
  const PictureTarget a = upload(p, 6, 7, 1);
  picture_target(ctx(), a);
  auto want = p.colour;
  for (float& v : want) v = std::clamp(v, 0.0f, 1.0f);
  EXPECT_EQ(ctx().read<float>(a.target), want);
  EXPECT_EQ(ctx().read<float>(a.dalpha), std::vector<float>(42, 0.0f));
}

TEST_P(PictureTargetOp, RejectsWhatDoesNotFit) {
  const GivenPicture p = selftest::given_picture(3, 4);
  const PictureTarget good = upload(p, 3, 4, 1);
  EXPECT_NO_THROW(picture_target(ctx(), good));
  const auto refused = [&](const auto& change) {
    PictureTarget a = good;
    change(a);
    EXPECT_THROW(picture_target(ctx(), a), Error);
  };
  refused([&](PictureTarget& a) { a.given = ctx().tensor({3, 4, 3}, Type::u8); });
  refused([&](PictureTarget& a) { a.given = ctx().tensor({3, 4, 4}); });
  refused([&](PictureTarget& a) { a.known = ctx().tensor({4, 3}, Type::u8); });
  refused([&](PictureTarget& a) { a.drawn.colour = ctx().tensor({3, 5, 3}); });
  refused([&](PictureTarget& a) { a.drawn.alpha = {}; });
  refused([&](PictureTarget& a) { a.target = ctx().tensor({3, 4}); });
  refused([&](PictureTarget& a) { a.dalpha = ctx().tensor({3, 4, 1}); });
}

}  // namespace
}  // namespace vsplat
