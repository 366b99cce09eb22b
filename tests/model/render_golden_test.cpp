// Drawing against the PyTorch specification's pictures, scene by scene, in both flavours.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "model/render.h"
#include "tests/support/device.h"
#include "tests/support/splat_golden.h"

namespace vsplat {
namespace {

using test::SplatGolden;

// 99.9 % of the values within 2e-3 of the largest (or 1), their mean within 1e-5: single pixels may flip at thresholds.
::testing::AssertionResult close_pictures(const Image& got, const Image& want) {
  if (got.data.size() != want.data.size())
    return ::testing::AssertionFailure() << got.data.size() << " values, " << want.data.size() << " expected";
  double largest = 1, sum = 0;
  for (const float v : want.data) largest = std::max(largest, std::abs(static_cast<double>(v)));
  std::vector<double> errors;
  for (std::size_t i = 0; i < got.data.size(); ++i) {
    errors.push_back(std::abs(static_cast<double>(got.data[i]) - want.data[i]) / largest);
    if (!std::isfinite(errors.back())) return ::testing::AssertionFailure() << "value " << i << " is " << got.data[i];
    sum += errors.back();
  }
  std::sort(errors.begin(), errors.end());
  // Rounded up: in a small picture no pixel may be off.
  const double share = std::ceil(0.999 * static_cast<double>(errors.size()));
  const double q = errors[static_cast<std::size_t>(share) - 1], mean = sum / static_cast<double>(errors.size());
  if (q <= 2e-3 && mean <= 1e-5) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "99.9 % within " << q << " (2e-3 expected), mean " << mean << " (1e-5)";
}

class RenderGolden : public ::testing::TestWithParam<std::tuple<Flavour, std::string>> {
 protected:
  Context& ctx() { return test::context(std::get<0>(GetParam())); }
  const std::string& name() const { return std::get<1>(GetParam()); }
};

TEST_P(RenderGolden, MatchesAndGivesTheSameBytesEveryTime) {
  VSPLAT_NEED_SPLAT(name());
  const SplatGolden golden = SplatGolden::load(name());
  const DeviceGaussians g = upload(ctx(), golden.gaussians);
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    SCOPED_TRACE("camera " + std::to_string(v));
    const Picture first = render_picture(ctx(), g, golden.cameras[v], golden.options);
    EXPECT_TRUE(close_pictures(first.colour, golden.pictures[v].colour)) << "colour";
    EXPECT_TRUE(close_pictures(first.alpha, golden.pictures[v].alpha)) << "alpha";
    EXPECT_TRUE(close_pictures(first.depth, golden.pictures[v].depth)) << "depth";
    for (int run = 0; run < 2; ++run) {
      const Picture again = render_picture(ctx(), g, golden.cameras[v], golden.options);
      EXPECT_EQ(first.colour.data, again.colour.data);
      EXPECT_EQ(first.alpha.data, again.alpha.data);
      EXPECT_EQ(first.depth.data, again.depth.data);
    }
  }
}

std::string case_name(const ::testing::TestParamInfo<RenderGolden::ParamType>& info) {
  return std::string(name_of(std::get<0>(info.param))) + "_" + std::get<1>(info.param);
}

INSTANTIATE_TEST_SUITE_P(Committed, RenderGolden,
                         ::testing::Combine(::testing::Values(Flavour::cpu, Flavour::gpu),
                                            ::testing::ValuesIn(test::splat_committed())),
                         case_name);
INSTANTIATE_TEST_SUITE_P(Made, RenderGolden,
                         ::testing::Combine(::testing::Values(Flavour::cpu, Flavour::gpu),
                                            ::testing::ValuesIn(test::splat_made())),
                         case_name);

}  // namespace
}  // namespace vsplat
