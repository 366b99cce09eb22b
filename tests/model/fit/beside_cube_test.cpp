#include "model/fit/beside_cube.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

// A grey picture of a camera that sees the cube in a central square of 20 pixels.
FitPicture seen_from(double distance) {
  FitPicture out;
  Camera& c = out.camera;
  c.width = 80, c.height = 40;
  c.fx = c.fy = 20 * (distance - 0.5);
  c.cx = 40, c.cy = 20;
  c.w2c = Eigen::Matrix4d::Identity();
  c.w2c(2, 3) = distance;
  out.rgba.assign(4 * 80 * 40, 128);
  for (std::size_t i = 3; i < out.rgba.size(); i += 4) out.rgba[i] = 255;
  return out;
}

TEST(BesideCube, CountsWhatIsNotWhiteThere) {
  FitPicture picture = seen_from(3);
  EXPECT_NEAR(shown_beside_cube(picture), 1 - 20 * 20 / 3200.0, 0.002);
  for (std::size_t i = 0; i < picture.rgba.size() / 2; ++i) picture.rgba[i] = 255;  // the upper half is white
  EXPECT_NEAR(shown_beside_cube(picture), 0.5 * (1 - 20 * 20 / 3200.0), 0.002);
  EXPECT_EQ(shown_beside_cube(seen_from(3), 1, {0.5f, 0.5f, 0.5f}), 0) << "it has the background's colour";
  picture.known.assign(80 * 40, 0);
  EXPECT_EQ(shown_beside_cube(picture), 0);
  picture.masked = true;
  EXPECT_EQ(shown_beside_cube(picture), 0);
  EXPECT_EQ(shown_beside_cube(seen_from(0.2)), 0) << "the camera is in the cube";
}

TEST(BesideCube, SaysWhatToDo) {
  EXPECT_EQ(doubts_about_cube({}, 0, 5), "");
  EXPECT_EQ(doubts_about_cube({0.1, 0.2}, 5, 5), "");
  const std::string text = doubts_about_cube({0.5, 0.3}, 4, 5);
  for (const char* words : {"4 of the 5 pictures", "40 %", "mask_path", "masks/", "(scale)"})
    EXPECT_NE(text.find(words), std::string::npos) << text;
}

}  // namespace
}  // namespace vsplat
