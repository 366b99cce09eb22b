#include "model/views/views.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "model/base/resample.h"
#include "model/io/picture/image_file.h"
#include "runtime/error.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

Image random_picture(int w, int h, int channels, unsigned seed) {
  std::mt19937 rng(seed);
  Image out(w, h, channels);
  for (float& v : out.data) v = static_cast<float>(rng() % 256) / 255.0f;
  return out;
}

Camera test_camera(int w, int h) {
  Camera camera;
  camera.file = "images/a.png";
  camera.width = w;
  camera.height = h;
  camera.fx = 1.3 * w;
  camera.fy = 1.1 * w;
  camera.cx = 0.5 * w + 3;
  camera.cy = 0.5 * h - 2;
  camera.w2c.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  camera.w2c.topRightCorner<3, 1>() = Eigen::Vector3d(0.1, -0.2, 4);
  return camera;
}

void expect_same_camera(const Camera& got, const Camera& want) {
  EXPECT_EQ(got.fx, want.fx);
  EXPECT_EQ(got.fy, want.fy);
  EXPECT_EQ(got.cx, want.cx);
  EXPECT_EQ(got.cy, want.cy);
  EXPECT_EQ(got.w2c, want.w2c);
  EXPECT_EQ(got.file, want.file);
}

// Red rises along x, green along y.
Image ramp(int w, int h) {
  Image out(w, h, 3);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      out.at(x, y)[0] = static_cast<float>((x + 0.5) / w);
      out.at(x, y)[1] = static_cast<float>((y + 0.5) / h);
    }
  return out;
}

Eigen::Vector2d project(const Camera& camera, const Eigen::Vector3d& p) {
  const Eigen::Vector3d at = camera.w2c.topLeftCorner<3, 3>() * p + camera.w2c.topRightCorner<3, 1>();
  return {camera.fx * at.x() / at.z() + camera.cx, camera.fy * at.y() / at.z() + camera.cy};
}

void expect_input_error(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing,
                        const std::string& words) {
  test::expect_error(Status::input, {words}, [&] { prepare_view(camera, picture, mask, framing); });
}

TEST(Views, APictureOfTheNetworksSizeIsTakenBitForBit) {
  const Image picture = random_picture(32, 32, 3, 1);
  const Camera camera = test_camera(32, 32);
  const PreparedView view = prepare_view(camera, picture, nullptr, {.size = 32});
  EXPECT_EQ(view.image.data, picture.data);
  EXPECT_TRUE(view.alpha.empty());
  EXPECT_FALSE(view.masked);
  expect_same_camera(view.camera, camera);
}

TEST(Views, AlphaAndMaskMultiplyOnWhite) {
  const Image picture = random_picture(16, 16, 4, 2), mask = random_picture(16, 16, 1, 3);
  const PreparedView view = prepare_view(test_camera(16, 16), picture, &mask, {.size = 16});
  for (int i = 0; i < 256; ++i) {
    const double a = static_cast<double>(picture.data[4 * i + 3]) * mask.data[i];
    for (int c = 0; c < 3; ++c) ASSERT_NEAR(view.image.data[3 * i + c], picture.data[4 * i + c] * a + 1 - a, 1e-6);
    ASSERT_NEAR(view.alpha.data[i], a, 1e-6);
  }
  EXPECT_TRUE(view.masked);
}

TEST(Views, ObjectPutsTheCubeInTheMiddle) {
  for (const Crop crop : {Crop::object, Crop::automatic}) {
    const Camera camera = test_camera(90, 60);
    const Framing framing{.size = 48, .crop = crop, .centre = {0.2, -0.1, 0.3}, .edge = 1.2};
    const PreparedView view = prepare_view(camera, random_picture(90, 60, 3, 4), nullptr, framing);
    EXPECT_EQ(view.camera.width, 48);
    EXPECT_EQ(view.camera.height, 48);
    EXPECT_EQ(view.image.width, 48);
    EXPECT_EQ(view.image.height, 48);
    EXPECT_NEAR((project(view.camera, framing.centre) - Eigen::Vector2d(24, 24)).norm(), 0, 1e-11);
    const double z = (camera.w2c * Eigen::Vector4d(0.2, -0.1, 0.3, 1)).z();
    EXPECT_NEAR(std::max(view.camera.fx, view.camera.fy) * 1.5 * 1.2 / z, 48, 1e-11);
    EXPECT_NEAR(view.camera.fx / view.camera.fy, camera.fx / camera.fy, 1e-14);
  }
}

// A ramp over the picture: each visible pixel has the value of the position that the view's own camera gives.
TEST(Views, IntrinsicsMoveWithThePicture) {
  const int w = 101, h = 64;
  const Image picture = ramp(w, h);
  const Camera camera = test_camera(w, h);
  for (const Crop crop : {Crop::automatic, Crop::object, Crop::crop, Crop::pad})
    for (const int size : {16, 33, 90}) {
      const PreparedView view = prepare_view(camera, picture, nullptr, {.size = size, .crop = crop, .edge = 0.9});
      int checked = 0;
      for (int j = 0; j < size; ++j)
        for (int i = 0; i < size; ++i) {
          const double u = (i + 0.5 - view.camera.cx) / view.camera.fx * camera.fx + camera.cx;
          const double v = (j + 0.5 - view.camera.cy) / view.camera.fy * camera.fy + camera.cy;
          const double margin = camera.fx / view.camera.fx + 1;  // a result pixel and the interpolation's reach
          if (u < margin || v < margin || u > w - margin || v > h - margin) continue;
          ++checked;
          ASSERT_NEAR(view.image.at(i, j)[0], u / w, 3e-6);
          ASSERT_NEAR(view.image.at(i, j)[1], v / h, 3e-6);
        }
      EXPECT_GT(checked, size * size / 4) << static_cast<int>(crop);
    }
}

TEST(Views, CropKeepsAndPadAddsWhite) {
  const Image picture = random_picture(20, 11, 3, 5);
  const PreparedView crop = prepare_view(test_camera(20, 11), picture, nullptr, {.size = 11, .crop = Crop::crop});
  const PreparedView pad = prepare_view(test_camera(20, 11), picture, nullptr, {.size = 20, .crop = Crop::pad});
  for (int y = 0; y < 11; ++y)
    for (int c = 0; c < 3; ++c) {
      for (int x = 0; x < 11; ++x) ASSERT_EQ(crop.image.at(x, y)[c], picture.at(x + 4, y)[c]);
      for (int x = 0; x < 20; ++x) ASSERT_EQ(pad.image.at(x, y + 5)[c], picture.at(x, y)[c]);
    }
  for (const int y : {0, 4, 16, 19})
    for (int x = 0; x < 20; ++x) ASSERT_EQ(pad.image.at(x, y)[1], 1.0f);
  EXPECT_EQ(crop.camera.cx, test_camera(20, 11).cx - 4);
  EXPECT_EQ(pad.camera.cy, test_camera(20, 11).cy + 5);
}

TEST(Views, WhatTheCameraLeavesOpenComesFromThePicture) {
  Camera camera = test_camera(40, 40);
  camera.width = camera.height = 0;
  camera.cx = std::numeric_limits<double>::quiet_NaN();
  camera.cy = 0;
  const PreparedView view = prepare_view(camera, random_picture(40, 40, 3, 6), nullptr, {.size = 10});
  EXPECT_EQ(view.camera.cx, 5);
  EXPECT_EQ(view.camera.cy, 5);
  EXPECT_NEAR(view.camera.fx, camera.fx / 4, 1e-12);
}

TEST(Views, DistortionIsGoneFromTheCamera) {
  Camera camera = test_camera(32, 32);
  camera.distortion = {Distortion::Model::opencv, {0.2, 0, 0.01}};
  const Image picture = random_picture(32, 32, 3, 7);
  const PreparedView view = prepare_view(camera, picture, nullptr, {.size = 32});
  EXPECT_EQ(view.camera.distortion.model, Distortion::Model::none);
  EXPECT_EQ(view.camera.distortion.k[0], 0);
  EXPECT_EQ(view.camera.fx, camera.fx);
  EXPECT_NE(view.image.data, picture.data);
}

TEST(Views, SizesThatDisagreeAreNamed) {
  const Framing framing{.size = 16};
  const Image picture = random_picture(30, 20, 3, 8);
  expect_input_error(test_camera(20, 30), picture, nullptr, framing, "only after turning by 90 degrees");
  expect_input_error(test_camera(60, 40), picture, nullptr, framing, "30 x 20 pixels, its camera 60 x 40");
  const Image mask(30, 21, 1, 1.0f);
  expect_input_error(test_camera(30, 20), picture, &mask, framing, "30 x 21");
}

TEST(Views, ACubeThatCannotBeFramedIsRefused) {
  const Image picture = random_picture(30, 20, 3, 9);
  expect_input_error(test_camera(30, 20), picture, nullptr, {.size = 16, .centre = {0, 0, -40}}, "not in front");
  expect_input_error(test_camera(30, 20), picture, nullptr, {.size = 16, .edge = 1e6}, "less than a pixel");
  expect_input_error(test_camera(30, 20), picture, nullptr, {.size = 16, .edge = std::nan("")}, "pixels wide");
  // Padding the whole picture needs no cube.
  EXPECT_NO_THROW(
      prepare_view(test_camera(30, 20), picture, nullptr, {.size = 16, .crop = Crop::pad, .centre = {0, 0, -40}}));
}

TEST(Views, AMaskWithoutWhiteIsWarnedOf) {
  const test::Warnings warnings;
  const Image mask(16, 16, 1, 1.0f / 255);
  prepare_view(test_camera(16, 16), random_picture(16, 16, 3, 10), &mask, {.size = 16});
  EXPECT_NE(warnings.text().find("white is the object"), std::string::npos) << warnings.text();
}

TEST(Views, ReadsFilesAndNamesThem) {
  const TemporaryFolder folder;
  const Image picture = random_picture(24, 24, 3, 11);
  write_png(folder / "a.png", picture);
  write_png(folder / "m.png", Image(24, 24, 1, 1.0f));
  write_png(folder / "small.png", Image(23, 24, 1, 1.0f));
  EXPECT_EQ(prepare_view(test_camera(24, 24), folder / "a.png", folder / "m.png", {.size = 24}).image.data,
            picture.data);
  EXPECT_EQ(prepare_view(test_camera(24, 24), folder / "a.png", "", {.size = 24}).image.data, picture.data);
  test::expect_error(Status::input, {folder / "a.png", folder / "small.png"},
                     [&] { prepare_view(test_camera(24, 24), folder / "a.png", folder / "small.png", {.size = 24}); });
}

TEST(Views, FitsHaveNames) {
  EXPECT_EQ(crop_from_name("auto"), Crop::automatic);
  EXPECT_EQ(crop_from_name("object"), Crop::object);
  EXPECT_EQ(crop_from_name("crop"), Crop::crop);
  EXPECT_EQ(crop_from_name("pad"), Crop::pad);
  EXPECT_THROW(crop_from_name("stretch"), Error);
}

TEST(WholeViews, APictureThatIsNotScaledIsTakenBitForBit) {
  for (const int longest : {0, 30, 31}) {
    const Image picture = random_picture(30, 17, 3, 12);
    const Camera camera = test_camera(30, 17);
    const WholeView view = whole_view(camera, picture, nullptr, longest, {"a", "m"});
    EXPECT_EQ(on_white(view.image).data, picture.data);
    EXPECT_TRUE(view.known.empty());
    EXPECT_EQ(view.camera.width, 30);
    EXPECT_EQ(view.camera.height, 17);
    expect_same_camera(view.camera, camera);
  }
}

// A ramp over the picture, scaled down by integer and other factors: every pixel shows the position that the view's own
// camera gives, none is covered partly, and less than a pixel is cut off at the right and at the bottom.
TEST(WholeViews, IntrinsicsMoveWithThePicture) {
  for (const auto& [w, h] : {std::array<int, 2>{101, 64}, {64, 101}, {80, 80}, {200, 3}}) {
    const Image picture = ramp(w, h);
    const Camera camera = test_camera(w, h);
    for (const int longest : {16, 40, 50, 79}) {
      SCOPED_TRACE(::testing::Message() << w << " x " << h << " to " << longest);
      const WholeView view = whole_view(camera, picture, nullptr, longest, {"a", "m"});
      const double step = std::max(w, h) / static_cast<double>(longest);
      ASSERT_EQ(std::max(view.image.width, view.image.height), longest);
      ASSERT_EQ(view.image.width, view.camera.width);
      ASSERT_EQ(view.image.height, view.camera.height);
      EXPECT_NEAR(camera.fx / view.camera.fx, step, 1e-9);
      EXPECT_NEAR(camera.fy / view.camera.fy, step, 1e-9);
      if (h >= step) {
        EXPECT_LE(view.camera.height * step, h + 1e-6);
        EXPECT_GT((view.camera.height + 1) * step, h - 1e-6);
      }
      for (int j = 0; j < view.image.height; ++j)
        for (int i = 0; i < view.image.width; ++i) {
          const double u = (i + 0.5 - view.camera.cx) / view.camera.fx * camera.fx + camera.cx;
          const double v = (j + 0.5 - view.camera.cy) / view.camera.fy * camera.fy + camera.cy;
          ASSERT_NEAR(view.image.at(i, j)[3], std::min(1.0, h / step), 1e-6);
          const double margin = step + 1;  // a result pixel and the interpolation's reach
          if (u < margin || v < margin || u > w - margin || v > h - margin) continue;
          ASSERT_NEAR(view.image.at(i, j)[0], u / w, 3e-6);
          ASSERT_NEAR(view.image.at(i, j)[1], v / h, 3e-6);
        }
    }
  }
}

// Alpha and mask multiply, premultiplied, when scaled down by area.
TEST(WholeViews, AlphaAndMaskMultiply) {
  const Image picture = random_picture(16, 12, 4, 13), mask = random_picture(16, 12, 1, 14);
  const WholeView view = whole_view(test_camera(16, 12), picture, &mask, 0, {"a", "m"});
  const WholeView half = whole_view(test_camera(16, 12), picture, &mask, 8, {"a", "m"});
  ASSERT_EQ(half.image.height, 6);
  for (int y = 0; y < 12; ++y)
    for (int x = 0; x < 16; ++x) {
      const double a = static_cast<double>(picture.at(x, y)[3]) * mask.at(x, y)[0];
      ASSERT_NEAR(view.image.at(x, y)[3], a, 1e-6);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(view.image.at(x, y)[c], picture.at(x, y)[c] * a, 1e-6);
    }
  for (int y = 0; y < 6; ++y)
    for (int x = 0; x < 8; ++x)
      for (int c = 0; c < 4; ++c) {
        double mean = 0;
        for (int k = 0; k < 4; ++k) mean += view.image.at(2 * x + k % 2, 2 * y + k / 2)[c] / 4.0;
        ASSERT_NEAR(half.image.at(x, y)[c], mean, 1e-6);
      }
  EXPECT_TRUE(half.known.empty());
}

// A lens whose photograph shows less in the corners than the pinhole would: those pixels are unknown, and all others
// are known, whatever the mask says.
TEST(WholeViews, KnownIsWhatTheLensShows) {
  const int w = 60, h = 44;
  Camera camera = test_camera(w, h);
  camera.distortion = {Distortion::Model::opencv, {0.9}};
  Image mask(w, h, 1, 1.0f);
  for (int x = 0; x < w; ++x) mask.at(x, h / 2)[0] = 0;
  for (const int longest : {0, 30}) {
    const WholeView view = whole_view(camera, Image(w, h, 3, 0.5f), &mask, longest, {"a", "m"});
    EXPECT_EQ(view.camera.distortion.model, Distortion::Model::none);
    ASSERT_EQ(view.known.width, view.camera.width);
    ASSERT_EQ(view.known.height, view.camera.height);
    int known = 0, unknown = 0;
    for (int j = 0; j < view.camera.height; ++j)
      for (int i = 0; i < view.camera.width; ++i) {
        // How far inside the photograph the pixel's farthest corner is.
        double within = 1e9;
        for (const double u : {0.0, 1.0})
          for (const double v : {0.0, 1.0}) {
            const double x = (i + u - view.camera.cx) / view.camera.fx, y = (j + v - view.camera.cy) / view.camera.fy;
            const double bend = 1 + 0.9 * (x * x + y * y);
            const double at_u = camera.fx * x * bend + camera.cx, at_v = camera.fy * y * bend + camera.cy;
            within = std::min({within, at_u, at_v, w - at_u, h - at_v});
          }
        const float got = view.known.at(i, j)[0];
        if (within > 0.5) {
          ASSERT_EQ(got, 1.0f) << i << " " << j;
          ++known;
        } else if (within < -0.5) {
          ASSERT_EQ(got, 0.0f) << i << " " << j;
          ++unknown;
        }
      }
    EXPECT_GT(known, 10 * view.camera.width);
    EXPECT_GT(unknown, view.camera.width);
  }
  camera.distortion = {Distortion::Model::opencv, {-0.1}};  // shows more than the pinhole
  const WholeView view = whole_view(camera, Image(w, h, 3, 0.5f), &mask, 0, {"a", "m"});
  ASSERT_FALSE(view.known.empty());
  for (const float v : view.known.data) ASSERT_EQ(v, 1.0f);
}

TEST(WholeViews, SizesThatDisagreeAreNamed) {
  const Image picture = random_picture(30, 20, 3, 8), mask(30, 21, 1, 1.0f);
  test::expect_error(Status::input, {"a.png", "30 x 20 pixels, its camera 60 x 40"}, [&] {
    whole_view(test_camera(60, 40), picture, nullptr, 0, {"a.png", "m.png"});
  });
  test::expect_error(Status::input, {"m.png", "30 x 21"}, [&] {
    whole_view(test_camera(30, 20), picture, &mask, 0, {"a.png", "m.png"});
  });
}

}  // namespace
}  // namespace vsplat
