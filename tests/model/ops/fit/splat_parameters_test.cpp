#include "model/ops/fit/splat_parameters.h"

#include <algorithm>

#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class SplatParametersOp : public test::FlavourTest {
 protected:
  // Scales from 4e-4 to 1.6, opacities from 2e-4 to 0.9997; where `share` are left out none is near 1 after it is
  // raised, where differences would see that it stops there.
  void make(std::size_t count, const Dropping& dropping) {
    n = static_cast<long>(count);
    const auto seed = static_cast<std::uint32_t>(count);
    means = test::random_floats(3 * count, seed + 1);
    log_scales = test::random_floats(3 * count, seed + 2, -7.8f, 0.5f);
    logits = test::random_floats(count, seed + 3, -8, 8);
    for (float& v : logits)
      if (std::abs(1 / (1 + std::exp(-v)) / (1 - dropping.share) - 1) < 1e-4f) v += 0.1f;
    x = {ctx().upload({n, 3}, means), ctx().upload({n, 3}, log_scales), ctx().upload({n, 4}, test::nans(4 * count)),
         ctx().upload({n}, logits), ctx().upload({n, 4, 3}, test::nans(12 * count))};
    drop = dropping;
  }

  std::vector<float> opacities() {
    const SplatParametersForward a{x, drop, ctx().upload({n, 3}, test::nans(static_cast<std::size_t>(3 * n))),
                                   ctx().upload({n}, test::nans(static_cast<std::size_t>(n)))};
    splat_parameters_forward(ctx(), a);
    return ctx().read<float>(a.opacities);
  }

  long n = 0;
  std::vector<float> means, log_scales, logits;
  SplatParameters x;
  Dropping drop;
};
VSPLAT_FLAVOURS(SplatParametersOp);
VSPLAT_OPERATION(SplatParametersOp, splat_parameters)

// As many as are asked for, others in another step and with another seed; those that stay are as much brighter.
TEST_P(SplatParametersOp, LeavesOutItsShareAnewInEveryStep) {
  const auto left_out = [&](const Dropping& dropping) {
    make(20000, dropping);
    logits.assign(20000, -1.0f);
    x.logits = ctx().upload({n}, logits);
    const auto got = opacities();
    std::vector<bool> out;
    double sum = 0;
    for (const float v : got) out.push_back(v == 0), sum += static_cast<double>(v);
    EXPECT_NEAR(sum / 20000, 1 / (1 + std::exp(1.0)), 0.01);  // five standard deviations
    return out;
  };
  const auto first = left_out({0.3f, 5, 1});
  EXPECT_NEAR(static_cast<double>(std::count(first.begin(), first.end(), true)), 6000, 5 * std::sqrt(20000 * 0.21));
  EXPECT_EQ(left_out({0.3f, 5, 1}), first);
  for (const Dropping& other :
       {Dropping{0.3f, 5, 2}, Dropping{0.3f, 6, 1}, Dropping{0.3f, std::uint64_t{5} << 32, 1}}) {
    const auto second = left_out(other);
    int both = 0;
    for (std::size_t i = 0; i < first.size(); ++i) both += first[i] && second[i];
    EXPECT_NEAR(both, 1800, 5 * std::sqrt(20000 * 0.09 * 0.91));  // as if they knew nothing of each other
  }
}

// exp(-x) beyond float's range, and logits of a scene that was opaque or empty: finite, and the ends of the interval.
TEST_P(SplatParametersOp, FarParametersStayFinite) {
  make(4, {});
  x.logits = ctx().upload({4}, std::vector<float>{-200, -90, 90, 200});
  EXPECT_NEAR(opacities()[0], 0.0f, 1e-37f);
  EXPECT_EQ(opacities()[3], 1);
  SplatParametersBackward a{x,
                            {},
                            {ctx().upload({4, 3}, means),
                             ctx().upload({4, 3}, means),
                             {},
                             ctx().upload({4}, std::vector<float>{1, 1, 1, 1}),
                             {}}};
  a.opacity_weight = 1;
  splat_parameters_backward(ctx(), a);
  for (const float v : ctx().read<float>(a.dgaussians.opacities)) EXPECT_NEAR(v, 0, 1e-30);
}

TEST_P(SplatParametersOp, RejectsWhatDoesNotFit) {
  make(3, {});
  const Tensor scales3 = ctx().tensor({3, 3}), three = ctx().tensor({3}), four = ctx().tensor({4});
  EXPECT_NO_THROW(splat_parameters_forward(ctx(), {x, {}, scales3, three}));
  EXPECT_THROW(splat_parameters_forward(ctx(), {x, {}, scales3, four}), Error);
  EXPECT_THROW(splat_parameters_forward(ctx(), {x, {}, three, three}), Error);
  EXPECT_THROW(splat_parameters_forward(ctx(), {x, {1.0f, 0, 0}, scales3, three}), Error);
  EXPECT_THROW(splat_parameters_forward(ctx(), {x, {-0.1f, 0, 0}, scales3, three}), Error);
  EXPECT_THROW(splat_parameters_forward(ctx(), {x, {test::nans(1)[0], 0, 0}, scales3, three}), Error);
  SplatParametersBackward a{x, {}, {scales3, scales3, {}, four, {}}};
  EXPECT_THROW(splat_parameters_backward(ctx(), a), Error);
  a.dgaussians.opacities = three;
  EXPECT_NO_THROW(splat_parameters_backward(ctx(), a));
  a.home_means = scales3;
  EXPECT_THROW(splat_parameters_backward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
