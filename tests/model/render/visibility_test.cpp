#include "model/render/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "model/base/scene.h"
#include "model/render/render.h"
#include "runtime/context.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

class Visibility : public test::FlavourTest {};

// Black Gaussians count as much as others. Each weight is measured without derivatives: a Gaussian that is white, with
// all others black, over black, makes a picture whose sum is its weight.
TEST_P(Visibility, IsTheSumOfBlendingWeights) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 14, 1, 48, 40, ""}, 6);
  for (float& v : scene.gaussians.sh) v = -5;
  const std::vector<Camera> cameras = {test::make_camera({"", 14, 1, 48, 40, ""}, 1),
                                       test::make_camera({"", 14, 1, 48, 40, ""}, 2)};
  std::size_t begun = 0;
  const std::vector<float> got = blending_weights(ctx(), scene, cameras, [&](std::size_t i) { EXPECT_EQ(i, begun++); });
  EXPECT_EQ(begun, 2u);
  ASSERT_EQ(got.size(), 14u);
  RenderOptions options;
  options.background = {0, 0, 0};
  for (std::size_t k = 0; k < got.size(); ++k) {
    Gaussians one = scene.gaussians;
    one.sh_degree = 0;
    one.sh.assign(3 * one.count, static_cast<float>(-0.5 / kShC0));
    for (std::size_t c = 0; c < 3; ++c) one.sh[3 * k + c] = static_cast<float>(0.5 / kShC0);
    double want = 0;
    for (const Camera& camera : cameras)
      for (const float v : render_picture(ctx(), upload(ctx(), one), camera, options).colour.data) want += v / 3;
    EXPECT_NEAR(got[k], want, 1e-3 * (1 + want)) << "Gaussian " << k;
  }
}

TEST(Heaviest, KeepsTheLargestAndOfEqualOnesTheFirst) {
  EXPECT_EQ(heaviest({1, 5, 2, 5, 2}, 3), (std::vector<bool>{false, true, true, true, false}));
  EXPECT_EQ(heaviest({1, 2}, 2), (std::vector<bool>{true, true}));
  EXPECT_EQ(heaviest({1, 2}, 1), (std::vector<bool>{false, true}));
}

VSPLAT_FLAVOURS(Visibility);

}  // namespace
}  // namespace vsplat
