#include "model/ops/fit/exposure.h"

#include "model/diagnose/selftest/reference/exposure.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using Doubles = std::vector<double>;

constexpr std::array<float, 3> kBehind = {0.2f, 0.9f, 0.5f};

class ExposureOp : public test::FlavourTest {
 protected:
  static Doubles doubles(const std::vector<float>& x) { return {x.begin(), x.end()}; }

  // Both directions on an h x w picture; the gradient against differences of a weighted sum of the result, which is
  // linear in each of map, colour and alpha: exact but for rounding.
  void check(long h, long w) {
    SCOPED_TRACE(::testing::Message() << h << " x " << w);
    const auto pixels = static_cast<std::size_t>(h * w);
    const auto seed = static_cast<std::uint32_t>(97 * h + w);
    const auto map = test::random_floats(12, seed), colour = test::random_floats(3 * pixels, seed + 1, -0.5f, 1.5f);
    const auto alpha = test::random_floats(pixels, seed + 2, 0, 1), weights = test::random_floats(3 * pixels, seed + 3);
    const auto dalpha = test::random_floats(pixels, seed + 4);
    const Tensor dmap = ctx().upload({12}, test::nans(12));
    const DevicePicture drawn{ctx().upload({h, w, 3}, colour), ctx().upload({h, w}, alpha), {}};
    const Tensor m = ctx().upload({12}, map), out = ctx().upload({h, w, 3}, test::nans(3 * pixels));
    exposure_forward(ctx(), {m, drawn, kBehind, out});
    const std::array<double, 3> background{kBehind[0], kBehind[1], kBehind[2]};
    const auto value = [&](const Doubles& x, const Doubles& c, const Doubles& a) {
      const Doubles shown = ref::exposure(x, c, a, background);
      double sum = 0;
      for (std::size_t i = 0; i < shown.size(); ++i) sum += weights[i] * shown[i];
      return sum;
    };
    const Doubles dm = doubles(map), dc = doubles(colour), da = doubles(alpha);
    EXPECT_TRUE(test::close(ctx().read<float>(out), ref::exposure(dm, dc, da, background), 1e-6));

    const PictureGradient by{ctx().upload({h, w, 3}, weights), ctx().upload({h, w}, dalpha), {}};
    exposure_backward(ctx(), {m, drawn, kBehind, by, dmap});
    const auto slopes = [&](Doubles x, const auto& at) {
      Doubles result;
      for (double& v : x) {
        const double here = v;
        v = here + 1;
        const double up = at(x);
        v = here - 1;
        result.push_back((up - at(x)) / 2);
        v = here;
      }
      return result;
    };
    EXPECT_TRUE(
        test::close(ctx().read<float>(dmap), slopes(dm, [&](const Doubles& x) { return value(x, dc, da); }), 2e-6));
    EXPECT_TRUE(test::close(ctx().read<float>(by.colour),
                            slopes(dc, [&](const Doubles& x) { return value(dm, x, da); }), 2e-6));
    Doubles want = slopes(da, [&](const Doubles& x) { return value(dm, dc, x); });
    for (std::size_t i = 0; i < want.size(); ++i) want[i] += dalpha[i];
    EXPECT_TRUE(test::close(ctx().read<float>(by.alpha), want, 2e-6));
  }
};
VSPLAT_FLAVOURS(ExposureOp);
VSPLAT_OPERATION(ExposureOp, exposure)

TEST_P(ExposureOp, MatchesReferenceAtEverySizeThatBreaksThings) {
  for (const auto& [h, w] : {std::pair{1L, 1L}, {1, 7}, {5, 51}, {16, 16}, {1, 257}, {31, 33}}) check(h, w);
}

TEST_P(ExposureOp, TheMapThatIsNoneChangesNothing) {
  const auto colour = test::random_floats(30, 1, 0, 1), alpha = test::random_floats(10, 2, 0, 1);
  const DevicePicture drawn{ctx().upload({2, 5, 3}, colour), ctx().upload({2, 5}, alpha), {}};
  const Tensor map = ctx().upload({12}, std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const Tensor out = ctx().upload({2, 5, 3}, test::nans(30));
  exposure_forward(ctx(), {map, drawn, kBehind, out});
  EXPECT_TRUE(test::close(ctx().read<float>(out), doubles(colour), 1e-6));
}

}  // namespace
}  // namespace vsplat
