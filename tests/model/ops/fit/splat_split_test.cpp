#include "model/ops/fit/splat_split.h"

#include <algorithm>
#include <cmath>

#include "model/diagnose/selftest/inputs/fit_states.h"
#include "model/render/render.h"
#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using selftest::logit;

class SplatSplitOp : public test::FlavourTest {
 protected:
  SplatParameters filled(long n, float value) {
    const auto t = [&](const Shape& shape) {
      long count = 1;
      for (const long d : shape) count *= d;
      return ctx().upload(shape, std::vector<float>(static_cast<std::size_t>(count), value));
    };
    return {t({n, 3}), t({n, 3}), t({n, 4}), t({n}), t({n, 1, 3})};
  }

  long split(const std::vector<float>& logits, long grow_to, long capacity, const std::vector<float>& scores) {
    const auto count = static_cast<long>(logits.size());
    SplatState all{filled(capacity, -2), filled(capacity, 0), filled(capacity, 0)};
    std::vector<float> padded = logits;
    padded.resize(static_cast<std::size_t>(capacity));
    all.x.logits = ctx().upload({capacity}, padded);
    logits_ = all.x.logits;
    return splat_split(ctx(), {all, count, grow_to, ctx().upload({static_cast<long>(scores.size())}, scores)});
  }
  Tensor logits_;
};
VSPLAT_FLAVOURS(SplatSplitOp);
VSPLAT_OPERATION(SplatSplitOp, splat_split)

TEST_P(SplatSplitOp, NotANumberNeitherIsSplitNorStays) {
  const float nan = std::nanf("");
  // The second has no opacity, the third no score: the fourth's is the highest.
  EXPECT_EQ(split({0, nan, 0, 0}, 4, 4, {1, 9, nan, 2}), 4);
  const auto got = ctx().read<float>(logits_);
  const float half = logit(1 - std::sqrt(0.5));
  EXPECT_TRUE(test::close(got, std::vector<double>{0, half, 0, half}, 1e-6));
}

// The halves of a Gaussian, drawn, are about as opaque in its middle and cover about as much. By the formula the
// covered sum changes by -12 % at opacity 0.1 and -4 % at 0.5; it grows with the opacity, to +16 % at 0.9.
TEST_P(SplatSplitOp, TheHalvesLookAsTheWhole) {
  const test::SceneCase c{"", 1, 0, 65, 65, ""};
  const Camera camera = test::make_camera(c, 3);
  const auto alpha_of = [&](const SplatParameters& x, std::size_t count) {
    Gaussians g;
    g.count = count;
    const auto some = [&](const Tensor& t, std::size_t each) {
      auto out = ctx().read<float>(t);
      out.resize(each * count);
      return out;
    };
    g.means = some(x.means, 3), g.quats = some(x.quats, 4), g.sh = some(x.sh, 3);
    for (const float s : some(x.log_scales, 3)) g.scales.push_back(std::exp(s));
    for (const float l : some(x.logits, 1)) g.opacities.push_back(1 / (1 + std::exp(-l)));
    return render_picture(ctx(), vsplat::upload(ctx(), g), camera, {}).alpha.data;
  };
  for (const double opacity : {0.1, 0.5, 0.8}) {
    const SplatState all{{ctx().upload({2, 3}, std::vector<float>{0.02f, -0.01f, 0.03f, 0, 0, 0}),
                          ctx().upload({2, 3}, std::vector<float>{-2.0f, -1.6f, -2.2f, 0, 0, 0}),
                          ctx().upload({2, 4}, std::vector<float>{0.8f, 0.3f, -0.4f, 0.2f, 0, 0, 0, 0}),
                          ctx().upload({2}, std::vector<float>{logit(opacity), 0}), filled(2, 0).sh},
                         filled(2, 0),
                         filled(2, 0)};
    const auto before = alpha_of(all.x, 1);
    ASSERT_EQ(splat_split(ctx(), {all, 1, 2, ctx().upload({1}, std::vector<float>{1})}), 2);
    const auto after = alpha_of(all.x, 2);
    double sum_before = 0, sum_after = 0;
    for (std::size_t i = 0; i < before.size(); ++i) sum_before += before[i], sum_after += after[i];
    const float most = *std::max_element(before.begin(), before.end());
    EXPECT_GT(most, 0.9 * opacity);
    EXPECT_NEAR(*std::max_element(after.begin(), after.end()), most, 0.15 * opacity);
    EXPECT_NEAR(sum_after, sum_before, 0.15 * sum_before);
  }
}

TEST_P(SplatSplitOp, RejectsWhatDoesNotFit) {
  EXPECT_THROW(split({1, 2, 3}, 2, 5, {1, 2, 3}), Error);
  EXPECT_THROW(split({1, 2, 3}, 6, 5, {1, 2, 3}), Error);
  EXPECT_THROW(split({1, 2, 3}, 4, 5, {1, 2}), Error);
  EXPECT_EQ(split({}, 3, 5, {}), 0);
}

}  // namespace
}  // namespace vsplat
