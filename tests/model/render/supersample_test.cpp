#include "model/render/supersample.h"

#include <gtest/gtest.h>

#include "model/render/render.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

Camera looking(int edge, double focal, double distance) {
  Camera out;
  out.width = out.height = edge;
  out.fx = out.fy = focal;
  out.cx = out.cy = 0.5 * edge;
  out.w2c(2, 3) = distance;
  return out;
}

TEST(Supersample, AsManyAsMakePixelsNoFiner) {
  const Detail detail{{0, 0, 0}, 0.01f};  // as for a focal length of 200 at distance 2
  EXPECT_EQ(samples_for(detail, looking(512, 500, 2)), 1);
  EXPECT_EQ(samples_for(detail, looking(200, 200, 2)), 1);
  EXPECT_EQ(samples_for(detail, looking(101, 101, 2)), 1);
  EXPECT_EQ(samples_for(detail, looking(100, 100, 2)), 2);
  EXPECT_EQ(samples_for(detail, looking(200, 200, 4)), 2);  // farther away
  EXPECT_EQ(samples_for(detail, looking(64, 64, 2)), 3);
  EXPECT_EQ(samples_for(detail, looking(4, 4, 2)), kMostSamples);
  EXPECT_EQ(samples_for(detail, looking(200, 200, -2)), 1);  // behind the camera
  EXPECT_EQ(samples_for(detail, looking(800, 200, 20)), 2);  // 10 by the detail, but the picture may not exceed 2048
  EXPECT_EQ(samples_for(detail, looking(5000, 200, 20)), 1);
  EXPECT_EQ(samples_for({{0, 0, 2}, 0.01f}, looking(200, 200, 2)), 2);  // the object is elsewhere
}

TEST(Supersample, DetailIsThatOfTheMiddleCamera) {
  const std::vector<Camera> cameras = {looking(64, 100, 1), looking(64, 100, 5), looking(64, 100, 2),
                                       looking(64, 100, -1)};
  const auto detail = detail_of(cameras, {0, 0, 1});
  ASSERT_TRUE(detail);
  EXPECT_FLOAT_EQ(detail->pixel, 0.03f);
  EXPECT_EQ(detail->at, (std::array<float, 3>{0, 0, 1}));
  EXPECT_FALSE(detail_of({looking(64, 100, -1)}, {0, 0, 0}));
  EXPECT_FALSE(detail_of({}, {0, 0, 0}));
}

class Supersampled : public test::FlavourTest {};
VSPLAT_FLAVOURS(Supersampled);

// Each map is the mean of the larger picture's, even if the principal point is off the centre.
TEST_P(Supersampled, IsTheMeanOfALargerPicture) {
  const test::SceneCase c{"", 300, 1, 37, 21, ""};
  const Gaussians g = test::make_scene(c, 3);
  const Camera camera = test::make_camera(c, 3);
  for (const int k : {2, 3}) {
    RenderOptions options;
    options.background = {1, 0.5f, 0};
    const Picture large = render_picture(ctx(), upload(ctx(), g), times_as_large(camera, k), options);
    options.supersample = k;
    const Picture got = render_picture(ctx(), upload(ctx(), g), camera, options);
    for (const auto& [small, of, channels] :
         {std::tuple{&got.colour, &large.colour, 3}, {&got.alpha, &large.alpha, 1}, {&got.depth, &large.depth, 1}}) {
      ASSERT_EQ(small->width, 37);
      ASSERT_EQ(small->height, 21);
      std::vector<double> want(small->data.size());
      for (std::size_t i = 0; i < of->data.size(); ++i) {
        const auto n = static_cast<std::size_t>(channels), by = static_cast<std::size_t>(k), w = std::size_t{37};
        want[(i / (n * by * w) / by * w + i / n % (by * w) / by) * n + i % n] +=
            static_cast<double>(of->data[i]) / (k * k);
      }
      for (std::size_t i = 0; i < want.size(); ++i) ASSERT_NEAR(small->data[i], want[i], 1e-5) << k << " at " << i;
    }
    options.supersample = 1;
    EXPECT_NE(got.colour.data, render_picture(ctx(), upload(ctx(), g), camera, options).colour.data);
  }
}

}  // namespace
}  // namespace vsplat
