#include "model/metrics/reference_picture.h"

#include <cmath>

#include "model/io/picture/image_file.h"
#include "tests/support/image_writers.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

Camera camera_of(int width, int height) {
  Camera c;
  c.width = width, c.height = height;
  c.fx = c.fy = 0.8 * width;
  c.cx = 0.45 * width, c.cy = 0.55 * height;
  return c;
}

TEST(ReferencePicture, IsOverTheBackground) {
  const test::TemporaryFolder folder;
  write_test_png(folder / "a.png", 2, 1, {255, 0, 51, 102, 0, 255, 0, 255}, {6});  // RGBA
  Image mask(2, 1, 1);
  mask.data = {1.0f, 0.2f};
  write_png(folder / "mask.png", mask);
  const Camera c = camera_of(2, 1);
  const Image plain = reference_picture(c, {folder / "a.png", ""}, 2, 1, {0.0f, 0.5f, 1.0f});
  const float alpha = 102 / 255.0f;
  const float wanted[] = {alpha, 0.5f * (1 - alpha), 0.2f * alpha + 1 - alpha, 0, 1, 0};
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(plain.data[i], wanted[i], 1e-6) << i;
  const Image masked = reference_picture(c, {folder / "a.png", folder / "mask.png"}, 2, 1, {0.0f, 0.5f, 1.0f});
  EXPECT_NEAR(masked.data[0], alpha, 1e-6);
  EXPECT_NEAR(masked.data[4], 0.2f + 0.8f * 0.5f, 1e-6);
  EXPECT_NEAR(masked.data[5], 0.8f, 1e-6);
}

TEST(ReferencePicture, KeepsEveryPixelWithoutDistortion) {
  const test::TemporaryFolder folder;
  Image in(7, 5, 3);
  for (std::size_t i = 0; i < in.data.size(); ++i) in.data[i] = static_cast<float>(i * 37 % 256) / 255.0f;
  write_png(folder / "a.png", in);
  EXPECT_EQ(reference_picture(camera_of(70, 50), {folder / "a.png", ""}, 7, 5, {1, 1, 1}).data, in.data);
}

// Straight bars distorted by a lens: undistortion makes them straight again, also at half the camera's size.
TEST(ReferencePicture, UndoesDistortion) {
  const test::TemporaryFolder folder;
  const auto scene = [](double x, double y) {
    return static_cast<float>(0.5 + 0.3 * std::sin(9 * x) * std::cos(7 * y));
  };
  Camera camera = camera_of(160, 120);
  camera.distortion = {Distortion::Model::opencv, {-0.2, 0.03}};
  for (const int part : {1, 2}) {
    const int w = 160 / part, h = 120 / part;
    const double fx = camera.fx / part, fy = camera.fy / part, cx = camera.cx / part, cy = camera.cy / part;
    Image photo(w, h, 3);
    for (int v = 0; v < h; ++v)
      for (int u = 0; u < w; ++u) {
        const double xd = (u + 0.5 - cx) / fx, yd = (v + 0.5 - cy) / fy;
        double x = xd, y = yd;
        for (int i = 0; i < 50; ++i) {
          const double r2 = x * x + y * y, scale = 1 - 0.2 * r2 + 0.03 * r2 * r2;
          x = xd / scale, y = yd / scale;
        }
        for (int c = 0; c < 3; ++c) photo.at(u, v)[c] = scene(x, y);
      }
    write_png(folder / "photo.png", photo);
    const Image out = reference_picture(camera, {folder / "photo.png", ""}, w, h, {0, 0, 0});
    ASSERT_EQ(out.width, w);
    ASSERT_EQ(out.height, h);
    for (int v = 3; v < h - 3; ++v)
      for (int u = 3; u < w - 3; ++u)
        EXPECT_NEAR(out.at(u, v)[1], scene((u + 0.5 - cx) / fx, (v + 0.5 - cy) / fy), 0.01) << u << " " << v;
  }
}

TEST(ReferencePicture, ScalesLargerOnesDownByArea) {
  const test::TemporaryFolder folder;
  Image in(9, 6, 3), mask(9, 6, 1, 1.0f);
  for (std::size_t i = 0; i < in.data.size(); ++i) in.data[i] = static_cast<float>(i * 37 % 256) / 255.0f;
  for (int y = 0; y < 6; ++y) mask.at(0, y)[0] = 0.0f;
  write_png(folder / "a.png", in);
  write_png(folder / "mask.png", mask);
  const Image out = reference_picture(camera_of(90, 60), {folder / "a.png", folder / "mask.png"}, 3, 2, {0, 1, 0});
  ASSERT_EQ(out.width, 3);
  ASSERT_EQ(out.height, 2);
  for (int c = 0; c < 3; ++c)
    for (int x = 0; x < 3; ++x) {
      double sum = 0;
      for (int v = 3; v < 6; ++v)
        for (int u = 3 * x; u < 3 * x + 3; ++u)
          sum += u == 0 ? (c == 1 ? 1.0 : 0.0) : static_cast<double>(in.at(u, v)[c]);
      EXPECT_NEAR(out.at(x, 1)[c], sum / 9, 1e-6) << x << " " << c;
    }
  Camera bent = camera_of(160, 120);
  bent.distortion = {Distortion::Model::opencv, {-1e-9}};
  write_png(folder / "flat.png", Image(320, 241, 3, 0.25f));  // 240.5 would be exact: one pixel of difference is
                                                              // accepted
  const Image flat = reference_picture(bent, {folder / "flat.png", ""}, 160, 120, {0, 0, 0});
  ASSERT_EQ(flat.height, 120);
  EXPECT_NEAR(flat.at(80, 60)[1], 64 / 255.0, 1e-6);
}

TEST(ReferencePicture, RefusesOtherSizes) {
  const test::TemporaryFolder folder;
  write_png(folder / "a.png", Image(4, 3, 3));
  write_png(folder / "mask.png", Image(3, 4, 1));
  const Camera c = camera_of(4, 3);
  expect_error(Status::input, {"a.png", "4 x 3", "8 x 6"}, [&] {
    reference_picture(c, {folder / "a.png", ""}, 8, 6, {1, 1, 1});
  });
  expect_error(Status::input, {"a.png", "4 x 3", "1 x 3"}, [&] {
    reference_picture(c, {folder / "a.png", ""}, 1, 3, {1, 1, 1});
  });
  expect_error(Status::input, {"mask.png", "3 x 4"}, [&] {
    reference_picture(c, {folder / "a.png", folder / "mask.png"}, 4, 3, {1, 1, 1});
  });
  expect_error(Status::file, {"none.png"}, [&] {
    reference_picture(c, {folder / "a.png", folder / "none.png"}, 4, 3, {1, 1, 1});
  });
}

}  // namespace
}  // namespace vsplat
