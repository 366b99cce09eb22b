#include "model/ops/volume/select.h"

#include "model/diagnose/selftest/reference/select.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SelectOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(SelectOp);
VSPLAT_OPERATION(SelectOp, select)

const char* const kSelections[] = {"gumbel", "sigmoid", "ste", "opacity"};

// What asks for nothing but the flags, and by the opacity alone.
TEST(Select, FlagsAlone) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<float> opacities = test::random_floats(65, 52, 0.0f, 1.0f);
  SelectForward a;
  a.opacities = ctx.upload({65}, opacities);
  a.selection = Selection::opacity;
  a.opacity_threshold = 0.4f;
  a.flags = ctx.upload({65}, std::vector<std::uint32_t>(65, 7), Type::u32);
  select_forward(ctx, a);
  std::vector<std::uint32_t> want;
  for (const float opacity : opacities) want.push_back(opacity > 0.4f);
  EXPECT_EQ(ctx.read<std::uint32_t>(a.flags), want);
  a.selection = Selection::sigmoid;
  EXPECT_THROW(select_forward(ctx, a), Error) << "without logits";
}

// Except that of "ste" by the logit, which is that of "sigmoid".
TEST(SelectReference, GradientsAreThoseOfDifferences) {
  const auto random = test::random_floats(4 * 50, 54);
  constexpr double step = 1e-5;
  for (const std::string selection : kSelections) {
    for (std::size_t i = 0; i < random.size(); i += 4) {
      const double logit = 3 * random[i], noise = 2 * random[i + 1], opacity = std::abs(random[i + 2]),
                   d = random[i + 3];
      const auto loss = [&](const std::string& kind, double by_logit, double by_opacity) {
        return d * ref::select(kind, logit + by_logit, noise, opacity + by_opacity, 0.7, 0.4).refined;
      };
      const ref::SelectGradient got = ref::select_backward(selection, logit, noise, opacity, 0.7, d);
      const std::string smooth = selection == "ste" ? "sigmoid" : selection;
      EXPECT_NEAR(got.logit, (loss(smooth, step, 0) - loss(smooth, -step, 0)) / (2 * step), 1e-9) << selection;
      EXPECT_NEAR(got.opacity, (loss(selection, 0, step) - loss(selection, 0, -step)) / (2 * step), 1e-9) << selection;
    }
  }
}

// A confidence that is all but certain still has a slope: 1 - sigmoid(x) would be rounded to 0.
TEST(Select, BackwardFarFromTheThreshold) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<float> logits = {-100, -60, -20, 20, 60, 100};
  SelectBackward a;
  a.logits = ctx.upload({6}, logits);
  a.opacities = a.drefined = ctx.upload({6}, std::vector<float>(6, 1.0f));
  a.selection = Selection::sigmoid;
  a.dlogits = ctx.upload({6}, test::nans(6));
  a.dopacities = ctx.tensor({6});
  select_backward(ctx, a);
  const std::vector<float> got = ctx.read<float>(a.dlogits);
  for (std::size_t i = 0; i < 6; ++i) {
    const double want = std::exp(-std::abs(static_cast<double>(logits[i])));
    EXPECT_NEAR(got[i], want, 1e-5 * want + 1e-37) << logits[i];
  }
}

// (That it is the host's, the case checks.)
TEST(Select, NoiseIsLogistic) {
  Context& ctx = test::context(Flavour::cpu);
  const Tensor noise = ctx.tensor({20001});
  logistic_noise(ctx, noise, 0x123456789abcdefULL, 7, 3);
  double sum = 0, squares = 0;
  for (const double v : ctx.read<float>(noise)) sum += v, squares += v * v;
  EXPECT_NEAR(sum / 20001, 0, 0.05);
  EXPECT_NEAR(squares / 20001, M_PI * M_PI / 3, 0.1);
}

TEST(Select, EmptyInput) {
  SelectBackward nothing;
  nothing.logits = nothing.opacities = nothing.drefined = nothing.dlogits = nothing.dopacities =
      test::context(Flavour::cpu).tensor({0});
  select_backward(test::context(Flavour::cpu), nothing);
}

TEST(Select, RejectsBadShapeAndValues) {
  Context& ctx = test::context(Flavour::cpu);
  SelectForward a;
  a.logits = a.opacities = a.factor = a.refined = ctx.tensor({4});
  a.flags = ctx.tensor({4});
  EXPECT_THROW(select_forward(ctx, a), Error);  // flags are not u32
  a.flags = ctx.tensor({4}, Type::u32);
  a.temperature = 0;
  EXPECT_THROW(select_forward(ctx, a), Error);
  EXPECT_THROW(selection_of("best"), Error);
  SelectBackward b;
  b.logits = b.opacities = b.drefined = b.dlogits = b.dopacities = ctx.tensor({4});
  b.temperature = 0;
  EXPECT_THROW(select_backward(ctx, b), Error);
  b.temperature = 1;
  b.dlogits = ctx.tensor({3});
  EXPECT_THROW(select_backward(ctx, b), Error);
  b.dlogits = b.dopacities = {};
  EXPECT_THROW(select_backward(ctx, b), Error);
}

}  // namespace
}  // namespace vsplat
