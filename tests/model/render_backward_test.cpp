#include "model/render_backward.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "tests/reference/splat.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"
#include "tests/support/splat_golden.h"
#include "tests/support/twist.h"

namespace vsplat {
namespace {

using test::SplatGolden;

// Of the largest value of each tensor.
constexpr double kTolerance = 1e-4;

PictureGradient upload_cotangent(Context& ctx, const Picture& p) {
  const long h = p.alpha.height, w = p.alpha.width;
  return {ctx.upload({h, w, 3}, p.colour.data), ctx.upload({h, w}, p.alpha.data), ctx.upload({h, w}, p.depth.data)};
}

struct Gradient {
  Gaussians gaussians;
  std::vector<std::array<double, 6>> poses;  // one a camera
};

// Of the sum over cameras.
Gradient differentiate(Context& ctx, const Gaussians& g, const std::vector<Camera>& cameras,
                       const RenderOptions& options, const std::vector<Picture>& cotangents) {
  const GaussianChunks scene = upload(ctx, g);
  const SceneGradient out = zero_gradient(ctx, scene);
  Gradient result;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    result.poses.emplace_back();
    render_backward(ctx, scene, cameras[v], options, upload_cotangent(ctx, cotangents[v]), out, &result.poses.back());
  }
  result.gaussians = download(ctx, out, g.sh_degree);
  return result;
}

class RenderBackwardGolden : public ::testing::TestWithParam<std::tuple<Flavour, std::string>> {
 protected:
  Context& ctx() { return test::context(std::get<0>(GetParam())); }
  const std::string& name() const { return std::get<1>(GetParam()); }
};

// Autograd in double, at scenes that keep clear of thresholds.
TEST_P(RenderBackwardGolden, MatchesAutogradAndGivesTheSameBytesEveryTime) {
  VSPLAT_NEED_SPLAT(name());
  const SplatGolden golden = SplatGolden::load(name());
  const auto run = [&] {
    return differentiate(ctx(), golden.gaussians, golden.cameras, golden.options, golden.cotangents);
  };
  const Gradient got = run();
  const Gaussians &g = got.gaussians, &want = golden.gradient;
  const auto all_zero = [](const std::vector<float>& v) {
    return std::all_of(v.begin(), v.end(), [](float x) { return x == 0; });
  };
  // A scene without any, and one that no view-dependent colour is in.
  const bool none = want.count == 0;
  EXPECT_TRUE(test::close(g.means, want.means, kTolerance, none)) << "means";
  EXPECT_TRUE(test::close(g.scales, want.scales, kTolerance, none)) << "scales";
  EXPECT_TRUE(test::close(g.quats, want.quats, kTolerance, none)) << "quats";
  EXPECT_TRUE(test::close(g.opacities, want.opacities, kTolerance, none)) << "opacities";
  EXPECT_TRUE(test::close(g.sh, want.sh, kTolerance, none)) << "sh";
  EXPECT_EQ(none, all_zero(want.means));
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    const auto &pose = got.poses[v], &wanted = golden.pose_gradient[v];
    EXPECT_TRUE(test::close(std::vector<double>(pose.begin(), pose.end()),
                            std::vector<double>(wanted.begin(), wanted.end()), kTolerance, none))
        << "pose " << v;
  }
  for (int i = 0; i < 2; ++i) {
    const Gradient again = run();
    EXPECT_EQ(again.gaussians.means, g.means);
    EXPECT_EQ(again.gaussians.scales, g.scales);
    EXPECT_EQ(again.gaussians.quats, g.quats);
    EXPECT_EQ(again.gaussians.opacities, g.opacities);
    EXPECT_EQ(again.gaussians.sh, g.sh);
    EXPECT_EQ(again.poses, got.poses);
  }
}

std::string case_name(const ::testing::TestParamInfo<RenderBackwardGolden::ParamType>& info) {
  return std::string(name_of(std::get<0>(info.param))) + "_" + std::get<1>(info.param);
}

INSTANTIATE_TEST_SUITE_P(Committed, RenderBackwardGolden,
                         ::testing::Combine(::testing::Values(Flavour::cpu, Flavour::gpu),
                                            ::testing::ValuesIn(test::splat_committed())),
                         case_name);
INSTANTIATE_TEST_SUITE_P(Made, RenderBackwardGolden,
                         ::testing::Combine(::testing::Values(Flavour::cpu, Flavour::gpu),
                                            ::testing::ValuesIn(test::splat_made())),
                         case_name);

}  // namespace
}  // namespace vsplat
