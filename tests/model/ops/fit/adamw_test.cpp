#include "model/ops/fit/adamw.h"

#include <array>
#include <cmath>
#include <limits>

#include "model/diagnose/selftest/reference/adamw.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Adamw : public test::FlavourTest {
 protected:
  Tensor upload(const std::vector<float>& x) { return ctx().upload({static_cast<long>(x.size())}, x); }
  Tensor zeros(std::size_t n) { return upload(std::vector<float>(n, 0.0f)); }

  // The norm, and the factor that the gradients are multiplied by.
  std::array<float, 2> clip(const std::vector<std::vector<float>>& grads, float scale = 1, float max_norm = 0.5f) {
    GradientClip a{{}, scale, max_norm, upload(test::nans(2))};
    for (const auto& grad : grads) a.grads.push_back(upload(grad));
    gradient_clip(ctx(), a);
    const auto out = ctx().read<float>(a.out);
    return {out[0], out[1]};
  }
};
VSPLAT_FLAVOURS(Adamw);
VSPLAT_OPERATION(Adamw, adamw)

// torch.optim.AdamW (PyTorch 1.13, float64; decay 0.05 on the first three, 0 on the last; lr = 0.1 * step) after
// clip_grad_norm_(parameters, 0.5).
TEST_P(Adamw, FourStepsMatchPyTorch) {
  const float grads[4][4] = {
      {0.3f, -0.8f, 0.0f, 1e-3f}, {0.1f, 0.4f, 0.0f, -2e-3f}, {-2.0f, 1.0f, 0.5f, 1e-3f}, {0.02f, -0.03f, 0.01f, 0.0f}};
  const double norms[4] = {0.8544009597372888, 0.4123154132457335, 2.2912880656957997, 0.03741657386773942};
  const double params[4][4] = {{0.397500005696, -0.895000002136, 1.99, 0.150001708775},
                               {0.202173210953, -0.880878879006, 1.9701, 0.254131847289},
                               {0.279145438686, -0.926685901242, 1.753581601775, 0.355718211951},
                               {0.352377582453, -0.962451129072, 1.491579364398, 0.468116106901}};
  AdamwStep decayed{upload({0.5f, -1.0f, 2.0f}), {}, zeros(3), zeros(3), upload(test::nans(2))};
  AdamwStep plain{upload({0.25f}), {}, zeros(1), zeros(1), decayed.clip};
  plain.weight_decay = 0;
  for (int s = 0; s < 4; ++s) {
    decayed.grad = upload({grads[s][0], grads[s][1], grads[s][2]});
    plain.grad = upload({grads[s][3]});
    gradient_clip(ctx(), {{decayed.grad, plain.grad}, 1, 0.5f, decayed.clip});
    EXPECT_NEAR(ctx().read<float>(decayed.clip)[0], norms[s], 1e-6 * norms[s]);
    for (AdamwStep* a : {&decayed, &plain}) {
      a->step = s + 1;
      a->lr = 0.1 * (s + 1);
      adamw_step(ctx(), *a);
    }
    auto got = ctx().read<float>(decayed.param);
    got.push_back(ctx().read<float>(plain.param)[0]);
    EXPECT_TRUE(test::close(got, std::vector<double>(params[s], params[s] + 4), 1e-6)) << "step " << s + 1;
  }
}

TEST_P(Adamw, WithoutGradientMomentsFadeAndDecayGoesOn) {
  AdamwStep a{upload({0.5f, -3.0f}), {}, upload({0.2f, 0.4f}), upload({1.0f, 4.0f}), {}, 10};
  a.lr = 4e-2;
  std::vector<double> param = {0.5, -3.0}, m = {0.2f, 0.4f}, v = {1, 4};
  adamw_step(ctx(), a);
  ref::adamw({a.lr, a.beta1, a.beta2, a.eps, a.weight_decay}, 10, {0, 0}, param, m, v);
  EXPECT_TRUE(test::close(ctx().read<float>(a.param), param, 1e-7));
  EXPECT_TRUE(test::close(ctx().read<float>(a.m), m, 1e-7));
  EXPECT_TRUE(test::close(ctx().read<float>(a.v), v, 1e-7));
}

// At the published rate a step takes 2e-5 of a weight: 1 - 2e-5 rounded to float is off by 2.7e-8, and a thousand
// products with it by 2.7e-5. What is left is the rounding of the weights themselves.
TEST_P(Adamw, SmallDecayIsNotRounded) {
  const std::vector<float> start = {1.0f, 0.83f, -0.61f, 0.5f, 3.0f};
  AdamwStep a{upload(start), {}, zeros(5), zeros(5), {}};
  for (a.step = 1; a.step <= 1000; ++a.step) adamw_step(ctx(), a);
  const auto got = ctx().read<float>(a.param);
  for (std::size_t i = 0; i < got.size(); ++i)
    EXPECT_NEAR(static_cast<double>(got[i]) / static_cast<double>(start[i]), std::pow(1 - 2e-5, 1000), 3e-6) << i;
}

// All of one sign and nearly equal, where a running sum in float would be off by a tenth of a percent and more.
TEST_P(Adamw, NormOfMillionsIsAsExactAsThatOfFew) {
  const std::vector<std::vector<float>> grads = {test::random_floats(3000000, 4, 0.9f, 1.1f),
                                                 test::random_floats(100003, 5, 0.0f, 1e-3f)};
  const double norm = ref::norm(grads);
  const auto got = clip(grads);
  EXPECT_NEAR(got[0], norm, 1e-6 * norm);
  EXPECT_EQ(got, clip(grads));
}

// 2^24, to which 1 cannot be added in float, and many ones, each in a block of its own: it takes the compensation to
// count them.
TEST_P(Adamw, NormCountsWhatIsSmallBesideTheLargest) {
  std::vector<float> grad(2048 * 3200);
  for (std::size_t i = 0; i < grad.size(); i += 2048) grad[i] = 1;
  grad[0] = 4096;
  const double norm = ref::norm({grad});
  EXPECT_NEAR(clip({grad})[0], norm, 2e-7 * norm);
}

TEST_P(Adamw, ClipsTinyNormsAsPyTorchDoes) {
  EXPECT_NEAR(clip({{6e-6f}, {8e-6f}}, 1, 5e-6f)[1], ref::clip_factor(1e-5, 5e-6), 1e-6);  // 5 / 11, not 5 / 10
}

TEST_P(Adamw, ShortGradientsAreNotClippedAndScaleCounts) {
  const std::vector<std::vector<float>> grads = {{0.3f, 0.0f}, {-0.4f}};  // norm 0.5
  auto got = clip(grads, 0.5f);
  EXPECT_NEAR(got[0], 0.25, 1e-7);
  EXPECT_EQ(got[1], 0.5f);
  got = clip(grads, 4.0f);
  EXPECT_NEAR(got[0], 2.0, 1e-6);
  EXPECT_NEAR(got[1], 4 * ref::clip_factor(2, 0.5), 1e-6);
  got = clip({{0.0f, 0.0f}});
  EXPECT_EQ(got[0], 0.0f);
  EXPECT_EQ(got[1], 1.0f);
}

TEST_P(Adamw, NormShowsWhatIsNotFinite) {
  const float infinity = std::numeric_limits<float>::infinity();
  EXPECT_TRUE(std::isnan(clip({{1.0f}, {2.0f, test::nans(1)[0]}})[0]));
  EXPECT_TRUE(std::isnan(clip({{1.0f}, {2.0f, test::nans(1)[0]}})[1]));
  EXPECT_FALSE(std::isfinite(clip({{1.0f, -infinity}, {2.0f}})[0]));
  // In another block than the first, among many.
  auto many = test::random_floats(9000, 6);
  many[8000] = infinity;
  EXPECT_FALSE(std::isfinite(clip({{1.0f}, many})[0]));
}

TEST_P(Adamw, NoGradientsAtAll) {
  GradientClip a{{Tensor(), ctx().tensor({0})}, 1, 0.5f, upload(test::nans(2))};
  gradient_clip(ctx(), a);
  EXPECT_EQ(ctx().read<float>(a.out), (std::vector<float>{0.0f, 1.0f}));
  const Tensor none = ctx().tensor({0, 3});
  adamw_step(ctx(), {none, none, none, none, {}});
  average_step(ctx(), none, none, 0.9);
}

TEST_P(Adamw, RejectsWhatDoesNotFit) {
  const Tensor two = zeros(2), three = zeros(3), whole = ctx().tensor({2}, Type::i32);
  EXPECT_THROW(adamw_step(ctx(), {two, two, three, two, {}}), Error);
  EXPECT_THROW(adamw_step(ctx(), {two, two, two, three, {}}), Error);
  EXPECT_THROW(adamw_step(ctx(), {two, three, two, two, {}}), Error);
  EXPECT_THROW(adamw_step(ctx(), {two, two, two, two, three}), Error);
  EXPECT_THROW(adamw_step(ctx(), {two, two, two, two, two, 0}), Error);
  EXPECT_THROW(gradient_clip(ctx(), {{two}, 1, 0.5f, three}), Error);
  EXPECT_THROW(gradient_clip(ctx(), {{whole}, 1, 0.5f, two}), Error);
  EXPECT_THROW(average_step(ctx(), two, three, 0.9), Error);
}

}  // namespace
}  // namespace vsplat
