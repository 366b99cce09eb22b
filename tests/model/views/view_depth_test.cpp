#include "model/views/view_depth.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/base/lens.h"
#include "model/io/picture/depth_file.h"
#include "model/io/picture/image_file.h"
#include "tests/support/compare.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

constexpr int kWide = 12, kHigh = 8;

Camera seeing() {
  Camera out;
  out.width = kWide, out.height = kHigh;
  out.fx = out.fy = 10, out.cx = kWide / 2.0, out.cy = kHigh / 2.0;
  return out;
}

// Depths in thousandths that tell their place; 0 at one pixel.
Image made(int width, int height) {
  Image out(width, height, 1);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = i == 5 ? 0.0f : 1.5f + 0.001f * static_cast<float>(i);
  return out;
}

class ViewDepth : public ::testing::Test {
 protected:
  ViewDepth() {
    set_.source = folder_ / "transforms.json";
    set_.views.resize(1);
    set_.views[0].depth = folder_ / "depth.png";
  }
  std::vector<float> depths(const Camera& listed, const Camera& shown, bool metric = true) {
    return listed_depths(set_, metric)(0, listed, shown);
  }

  test::TemporaryFolder folder_;
  ViewSet set_;
};

TEST_F(ViewDepth, WholeNumbersHaveAUnitAndFloatsAreLengths) {
  const Image depth = made(kWide, kHigh);
  write_depth_png(folder_ / "depth.png", depth);
  const auto near_to = [&](const std::vector<float>& got, double factor) {
    ASSERT_EQ(got.size(), depth.data.size());
    for (std::size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i] / factor, depth.data[i], 1e-6) << i;
  };
  near_to(depths(seeing(), seeing()), 1);
  set_.depth_unit = 0.5;  // 1500 and so on of them
  near_to(depths(seeing(), seeing()), 500);
  near_to(depths(seeing(), seeing(), false), 1 / 1.595);
  Image values = depth;
  values.data[7] = std::numeric_limits<float>::infinity(), values.data[8] = -1, values.data[9] = std::nanf("");
  write_exr_raw(folder_ / "depth.exr", Image(kWide, kHigh, 3), Image(kWide, kHigh, 1), values);
  set_.views[0].depth = folder_ / "depth.exr";
  set_.depth_unit.reset();
  const std::vector<float> got = depths(seeing(), seeing());
  for (std::size_t i = 0; i < got.size(); ++i) EXPECT_EQ(got[i], i >= 7 && i < 10 ? 0 : depth.data[i]) << i;
  set_.depth_unit = 2;
  EXPECT_EQ(depths(seeing(), seeing())[3], 2 * depth.data[3]);
}

// No value lies between those of the depth picture, whatever its size.
TEST_F(ViewDepth, ThePictureAndItsDepthsMayHaveOtherSizes) {
  write_depth_png(folder_ / "depth.png", made(kWide / 2, kHigh / 2));
  const std::vector<float> got = depths(seeing(), seeing());
  const Image depth = made(kWide / 2, kHigh / 2);
  for (int y = 0; y < kHigh; ++y)
    for (int x = 0; x < kWide; ++x)
      EXPECT_NEAR(got[static_cast<std::size_t>(kWide * y + x)], *depth.at(x / 2, y / 2), 1e-6) << x << ", " << y;
  Camera small = seeing();
  for (double* length : {&small.fx, &small.fy, &small.cx, &small.cy}) *length /= 4;
  small.width /= 4, small.height /= 4;
  const std::vector<float> few = depths(seeing(), small);
  ASSERT_EQ(few.size(), 6U);
  EXPECT_NEAR(few[0], *depth.at(1, 1), 1e-6);  // what lies at a pixel's centre
  EXPECT_NEAR(few[5], *depth.at(5, 3), 1e-6);
}

TEST_F(ViewDepth, ALensIsUndone) {
  write_depth_png(folder_ / "depth.png", made(kWide, kHigh));
  Camera listed = seeing();
  listed.distortion.model = Distortion::Model::opencv;
  listed.distortion.k[0] = -0.3;
  const Image depth = made(kWide, kHigh);
  const std::vector<float> got = depths(listed, seeing());
  const Lens lens(listed.distortion, 1);
  int moved = 0;
  for (int y = 0; y < kHigh; ++y)
    for (int x = 0; x < kWide; ++x) {
      double u = (x + 0.5 - listed.cx) / listed.fx, v = (y + 0.5 - listed.cy) / listed.fy;
      ASSERT_TRUE(lens.distort(u, v, u, v));
      const int column = static_cast<int>(listed.fx * u + listed.cx), row = static_cast<int>(listed.fy * v + listed.cy);
      EXPECT_NEAR(got[static_cast<std::size_t>(kWide * y + x)], *depth.at(column, row), 1e-6);
      moved += column != x || row != y;
    }
  EXPECT_GT(moved, 10);
}

TEST_F(ViewDepth, WhatCannotBeReadIsNamed) {
  const auto refused = [&](Status status, const std::string& words) {
    const std::string text = test::refusal([&] { depths(seeing(), seeing()); }, status);
    EXPECT_NE(text.find(words), std::string::npos) << text;
  };
  refused(Status::file, "depth.png");
  write_png(folder_ / "depth.png", Image(kWide, kHigh, 1, 0.5f));
  EXPECT_NEAR(depths(seeing(), seeing())[0], 0.128, 1e-6);
  Image colours(kWide, kHigh, 3, 0.5f);
  colours.data[10] = 0.6f;
  write_png(folder_ / "depth.png", colours);
  refused(Status::format, "the pixel at 3, 0 has a colour");
  write_jpeg(folder_ / "depth.png", colours, 90);
  refused(Status::format, "a grey PNG or an EXR");
  write_depth_png(folder_ / "depth.png", made(kWide, kHigh + 2));
  refused(Status::input, "a depth picture must have its picture's shape");
  set_.views[0].depth.clear();
  refused(Status::input, "no frame names one");
  set_.views.resize(2);
  set_.views[1].depth = folder_ / "depth.png";
  const test::Warnings warnings;
  const ViewDepths some = listed_depths(set_, true);
  EXPECT_NE(warnings.text().find("1 of 2 frames"), std::string::npos) << warnings.text();
  EXPECT_EQ(some(0, seeing(), seeing()), std::vector<float>(std::size_t{kWide} * kHigh, 0.0f));
}

TEST_F(ViewDepth, PointsOfAColmapModel) {
  EXPECT_NE(test::refusal([&] { point_depths(set_); }, Status::input).find("only a COLMAP model"), std::string::npos);
  const std::string images =
      "7 1 0 0 0 0 0 0 1 a.png\n1 1 0 2 2 1\n3 1 0 0 0 0 0 2 1 b.png\n\n";  // b stands two units further back
  test::put_file(folder_ / "cameras.txt", "1 PINHOLE 12 8 10 10 6 4\n");
  test::put_file(folder_ / "images.txt", images);
  const std::string few =
      "1 0.1 0.1 4 9 9 9 0.1 7 0 3 0 99 0\n"     // at (6.25, 4.25) in a
      "2 0.11 0.1 5 9 9 9 0.1 7 1 98 0 99 1\n"   // in the same pixel, farther
      "3 -1 0 3 9 9 9 0.1 3 1 98 1 99 2\n"       // in b alone, and in images that are not there
      "4 9 9 1 9 9 9 0.1 7 2 98 2 99 3\n"        // beside a's picture
      "5 0.1 0.1 2 9 9 9 0.1 7 3 3 2\n"          // seen by two pictures only
      "6 0.1 0.1 2.5 9 9 9 2.5 7 4 3 3 99 4\n";  // with a large error
  std::string many = few;
  for (int i = 7; i < 37; ++i) many += fmt::format("{} 0 0 1 9 9 9 0.1 97 0 98 0 99 0\n", i);
  set_ = {};
  set_.source = folder_.path();
  set_.views.resize(2);
  set_.views[0].colmap_image = 7, set_.views[1].colmap_image = 3;
  test::put_file(folder_ / "points3D.txt", many);
  const ViewDepths points = point_depths(set_);
  Camera back = seeing();
  back.w2c(2, 3) = 2;
  const auto given = [](const std::vector<float>& depth) {
    std::vector<std::pair<std::size_t, float>> out;
    for (std::size_t i = 0; i < depth.size(); ++i)
      if (depth[i] != 0) out.emplace_back(i, depth[i]);
    return out;
  };
  using Given = std::vector<std::pair<std::size_t, float>>;
  EXPECT_EQ(given(points(0, seeing(), seeing())), (Given{{4 * kWide + 6, 4.0f}}));
  EXPECT_EQ(given(points(1, back, back)), (Given{{4 * kWide + 4, 5.0f}, {4 * kWide + 6, 6.0f}}));
  // Where few are reliable, all count.
  test::put_file(folder_ / "points3D.txt", few);
  EXPECT_EQ(given(point_depths(set_)(0, seeing(), seeing())), (Given{{4 * kWide + 6, 2.0f}}));
}

}  // namespace
}  // namespace vsplat
