#include "model/base/resample.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

namespace vsplat {
namespace {

Image resample(const Image& premultiplied, const Window& window) {
  ImageRows rows(premultiplied);
  return vsplat::resample(rows, window);
}

Image resample_undistorted(const Image& premultiplied, const Window& window, const Camera& camera) {
  ImageRows rows(premultiplied);
  return vsplat::resample_undistorted(rows, window, camera);
}

Image random_picture(int w, int h, int channels, unsigned seed) {
  std::mt19937 rng(seed);
  Image out(w, h, channels);
  for (float& v : out.data) v = static_cast<float>(rng() % 256) / 255.0f;
  return out;
}

// An opaque picture with the value of f at the pixel centres in every channel.
Image drawn(int w, int h, const std::function<double(double, double)>& f) {
  Image out(w, h, 4, 1.0f);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) std::fill_n(out.at(x, y), 3, static_cast<float>(f(x + 0.5, y + 0.5)));
  return out;
}

double largest_difference(const Image& a, const Image& b) {
  EXPECT_EQ(a.data.size(), b.data.size());
  double worst = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i)
    worst = std::max(worst, std::abs(static_cast<double>(a.data[i]) - b.data[i]));
  return worst;
}

TEST(Resample, KeepsPixelsThatAreNotScaled) {
  const Image in = premultiplied(random_picture(31, 23, 4, 1));
  const Image whole = resample(in, {0, 0, 17, 17});
  const Image moved = resample(in, {-3, 5, 29, 29});
  for (int y = 0; y < 17; ++y)
    for (int x = 0; x < 17; ++x)
      for (int c = 0; c < 4; ++c) ASSERT_EQ(whole.at(x, y)[c], in.at(x, y)[c]);
  for (int y = 0; y < 29; ++y)
    for (int x = 0; x < 29; ++x)
      for (int c = 0; c < 4; ++c) {
        const int u = x - 3, v = y + 5;
        ASSERT_EQ(moved.at(x, y)[c], u >= 0 && u < 31 && v < 23 ? in.at(u, v)[c] : 0.0f);
      }
}

TEST(Resample, AveragesBlocksWhenMadeAWholeNumberSmaller) {
  const Image in = premultiplied(random_picture(21, 21, 3, 2));
  const Image out = resample(in, {0, 0, 21, 7});
  for (int y = 0; y < 7; ++y)
    for (int x = 0; x < 7; ++x)
      for (int c = 0; c < 3; ++c) {
        double mean = 0;
        for (int k = 0; k < 9; ++k) mean += in.at(3 * x + k % 3, 3 * y + k / 3)[c] / 9.0;
        ASSERT_NEAR(out.at(x, y)[c], mean, 1e-6);
      }
}

// The picture and its intrinsics change consistently: each result pixel of a ramp has the value of its position.
TEST(Resample, ReproducesRampsAtEveryScale) {
  const auto ramp = [](double x, double y) { return 0.2 + 0.003 * x + 0.002 * y; };
  const Image in = drawn(97, 83, ramp);
  for (const double step : {0.13, 0.5, 0.99, 1.0, 1.01, 1.37, 2.0, 2.71, 5.3})
    for (const double x0 : {10.0, 11.283})
      for (const int size : {1, 9}) {
        const Window window{x0, 14.61, step * size, size};
        const Image out = resample(in, window);
        for (int j = 0; j < size; ++j)
          for (int i = 0; i < size; ++i) {
            const double want = ramp(window.x0 + (i + 0.5) * step, window.y0 + (j + 0.5) * step);
            ASSERT_NEAR(out.at(i, j)[0], want, 2e-6) << "step " << step << ", pixel " << i << " " << j;
            ASSERT_NEAR(out.at(i, j)[3], 1, 1e-6);
          }
      }
}

TEST(Resample, CoversInPartWhereThePictureEnds) {
  const Image in(10, 10, 4, 1.0f);
  const Image out =
      resample(in, {-5, 2.5, 12, 4});  // columns of 3 pixels from -5: -5, -2, 1, 4; rows from 2.5: .., 8.5, 11.5
  const double column[] = {0, 1.0 / 3, 1, 1}, row[] = {1, 1, 0.5, 0};
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) EXPECT_NEAR(out.at(i, j)[3], column[i] * row[j], 1e-6) << i << " " << j;
}

TEST(Resample, DoesNotDarkenTheBorderOfTheWholePicture) {
  const Image in(40, 40, 4, 1.0f);
  for (const int size : {7, 40, 99}) {
    const Image out = resample(in, {0, 0, 40, size});
    for (const float v : out.data) ASSERT_NEAR(v, 1, 1e-6);
  }
}

// One colour with a soft edge over noise: every visible result pixel has that colour.
TEST(Resample, NothingBleedsFromBehindAlphaZero) {
  std::mt19937 rng(4);
  Image picture = random_picture(60, 60, 4, 3);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) {
      float* p = picture.at(x, y);
      p[3] = static_cast<float>(std::clamp(20.5 - std::hypot(x - 30.0, y - 30.0), 0.0, 1.0));
      if (p[3] > 0) {
        p[0] = 0.9f;
        p[1] = 0.1f;
        p[2] = 0.4f;
      }
    }
  for (const int size : {13, 30, 77}) {
    const Image out = resample(premultiplied(picture), {1.5, 2.5, 55, size});
    const Image shown = on_white(out);
    for (std::size_t i = 0; i < out.data.size() / 4; ++i) {
      const float a = out.data[4 * i + 3];
      ASSERT_NEAR(shown.data[3 * i], 0.9f * a + 1 - a, 1e-6);
      ASSERT_NEAR(shown.data[3 * i + 1], 0.1f * a + 1 - a, 1e-6);
      ASSERT_NEAR(shown.data[3 * i + 2], 0.4f * a + 1 - a, 1e-6);
    }
  }
}

TEST(Resample, AnEmptyOverlapIsWhite) {
  const Image in = premultiplied(random_picture(8, 8, 3, 5));
  for (const Window& window : {Window{100, 0, 10, 5}, Window{0, -50, 20, 5}, Window{-1e9, 1e9, 3, 2}})
    for (const float v : on_white(resample(in, window)).data) ASSERT_EQ(v, 1.0f);
}

Camera camera_with(const Distortion& distortion) {
  Camera camera;
  camera.width = 120;
  camera.height = 90;
  camera.fx = 100;
  camera.fy = 110;
  camera.cx = 57;
  camera.cy = 47;
  camera.distortion = distortion;
  return camera;
}

TEST(ResampleUndistorted, IsTheSameWithoutDistortion) {
  Image picture = random_picture(120, 90, 4, 6);
  const Image in = premultiplied(picture);
  const Camera camera = camera_with({Distortion::Model::opencv, {1e-13}});
  for (const double side : {20.0, 48.0, 77.7, 130.0, 400.0}) {
    const Window window{13.3, -4.1, side, 48};
    EXPECT_LT(largest_difference(resample(in, window), resample_undistorted(in, window, camera)), 1e-5) << side;
  }
}

// The undistorted position of (u, v): Newton's method on an independent implementation of the models, with a difference
// quotient.
void undistorted(const Camera& camera, double u, double v, double& x, double& y) {
  const auto forward = [&](double a, double b, double& c, double& d) {
    const double* k = camera.distortion.k;
    const double q = a * a + b * b;
    if (camera.distortion.model == Distortion::Model::fisheye) {
      const double r = std::sqrt(q), t = std::atan(r), t2 = t * t;
      const double s = r < 1e-9 ? 1 : t / r * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
      c = a * s;
      d = b * s;
    } else {
      const double s = (1 + q * (k[0] + q * (k[1] + q * k[4]))) / (1 + q * (k[5] + q * (k[6] + q * k[7])));
      c = a * s + 2 * k[2] * a * b + k[3] * (q + 2 * a * a);
      d = b * s + k[2] * (q + 2 * b * b) + 2 * k[3] * a * b;
    }
  };
  const double xd = (u - camera.cx) / camera.fx, yd = (v - camera.cy) / camera.fy, h = 1e-6;
  x = xd;
  y = yd;
  for (int i = 0; i < 30; ++i) {
    double c, d, cx, dx, cy, dy;
    forward(x, y, c, d);
    forward(x + h, y, cx, dx);
    forward(x, y + h, cy, dy);
    const double a11 = (cx - c) / h, a12 = (cy - c) / h, a21 = (dx - d) / h, a22 = (dy - d) / h,
                 det = a11 * a22 - a12 * a21;
    x -= (a22 * (c - xd) - a12 * (d - yd)) / det;
    y -= (a11 * (d - yd) - a21 * (c - xd)) / det;
  }
}

// A scene that is smooth in the undistorted picture, photographed through the lens: resampling restores it.
TEST(ResampleUndistorted, BringsBackWhatThePinholeSees) {
  const auto scene = [](double x, double y) { return 0.5 + 0.2 * std::sin(5 * x + 1) + 0.2 * std::cos(4 * y - 2 * x); };
  for (const Distortion& distortion :
       {Distortion{Distortion::Model::opencv, {0.3}}, Distortion{Distortion::Model::opencv, {-0.3, 0.05}},
        Distortion{Distortion::Model::opencv, {0.1, -0.05, 0.01, -0.02, 0.01, 0.05, 0.02, 0.01}},
        Distortion{Distortion::Model::fisheye, {}},
        Distortion{Distortion::Model::fisheye, {-0.1, 0.02, -0.01, 0.003}}}) {
    const Camera camera = camera_with(distortion);
    const Image photo = drawn(120, 90, [&](double u, double v) {
      double x, y;
      undistorted(camera, u, v, x, y);
      return scene(x, y);
    });
    for (const int size : {24, 60, 150}) {
      const Window window{22, 10, 70, size};
      const Image out = resample_undistorted(photo, window, camera);
      double worst = 0;
      for (int j = 0; j < size; ++j)
        for (int i = 0; i < size; ++i) {
          if (out.at(i, j)[3] < 0.999f) continue;  // beyond the photograph's border
          const double u = window.x0 + (i + 0.5) * window.side / size, v = window.y0 + (j + 0.5) * window.side / size;
          worst = std::max(worst,
                           std::abs(out.at(i, j)[0] - scene((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy)));
        }
      // A pixel's mean differs from the value at its centre by at most width^2 / 24 of the scene's curvature (13 /
      // fx^2).
      EXPECT_LT(worst, size == 24 ? 1.5e-3 : 4e-4)
          << "model " << static_cast<int>(distortion.model) << ", k1 " << distortion.k[0] << ", size " << size;
    }
  }
}

TEST(ResampleUndistorted, IsWhiteBeyondTheFold) {
  const Camera camera = camera_with({Distortion::Model::opencv, {-0.5}});
  const Image in(120, 90, 4, 0.25f);
  const Window window{-200, -200, 500, 100};
  const Image out = resample_undistorted(in, window, camera);
  int seen = 0;
  for (int j = 0; j < 100; ++j)
    for (int i = 0; i < 100; ++i) {
      const double x = (window.x0 + (i + 0.5) * 5 - camera.cx) / camera.fx,
                   y = (window.y0 + (j + 0.5) * 5 - camera.cy) / camera.fy;
      const float a = out.at(i, j)[3];
      ASSERT_TRUE(a >= 0 && a <= 0.2501f);
      seen += a > 0;
      EXPECT_TRUE(std::hypot(x, y) <= std::sqrt(2.0 / 3) || a == 0) << i << " " << j;
    }
  EXPECT_GT(seen, 300);
}

// A rectangular picture, unscaled: every pixel is kept, and nothing is added beside it.
TEST(Resample, KeepsARectangularPictureThatIsNotScaled) {
  const Image in = premultiplied(random_picture(31, 23, 4, 8));
  const Image whole = resample(in, {0, 0, 31, 31, 23});
  EXPECT_EQ(whole.width, 31);
  EXPECT_EQ(whole.height, 23);
  EXPECT_EQ(whole.data, in.data);
  const Image tall = resample(premultiplied(random_picture(5, 40, 4, 9)), {0, 0, 5, 5, 40});
  EXPECT_EQ(tall.data, premultiplied(random_picture(5, 40, 4, 9)).data);
  const Image part = resample(in, {-3, 20, 12, 12, 5});
  for (int y = 0; y < 5; ++y)
    for (int x = 0; x < 12; ++x)
      for (int c = 0; c < 4; ++c) {
        const int u = x - 3, v = y + 20;
        ASSERT_EQ(part.at(x, y)[c], u >= 0 && v < 23 ? in.at(u, v)[c] : 0.0f);
      }
}

TEST(Resample, ReproducesRampsInRectangularWindows) {
  const auto ramp = [](double x, double y) { return 0.2 + 0.003 * x + 0.002 * y; };
  const Image in = drawn(97, 83, ramp);
  for (const double step : {0.13, 1.0, 1.37, 2.71, 5.3})
    for (const auto& [size, rows] : {std::array<int, 2>{9, 1}, {1, 9}, {7, 9}}) {
      const Window window{11.283, 14.61, step * size, size, rows};
      const Image out = resample(in, window);
      ASSERT_EQ(out.width, size);
      ASSERT_EQ(out.height, rows);
      for (int j = 0; j < rows; ++j)
        for (int i = 0; i < size; ++i)
          ASSERT_NEAR(out.at(i, j)[0], ramp(window.x0 + (i + 0.5) * step, window.y0 + (j + 0.5) * step), 2e-6)
              << "step " << step << ", pixel " << i << " " << j;
    }
}

// The rows of a rectangular window equal those of the square window around it.
TEST(ResampleUndistorted, RectangularWindowsArePartsOfSquareOnes) {
  const Image in = premultiplied(random_picture(120, 90, 4, 10));
  for (const Camera& camera : {camera_with({Distortion::Model::opencv, {0.2, -0.05, 0.01, -0.02}}),
                               camera_with({Distortion::Model::fisheye, {-0.1, 0.02}})})
    for (const double side : {40.0, 110.0}) {
      const Image whole = resample_undistorted(in, {5.5, 3, side, 48}, camera);
      const Image part = resample_undistorted(in, {5.5, 3, side, 48, 19}, camera);
      ASSERT_EQ(part.height, 19);
      EXPECT_EQ(part.data, std::vector<float>(whole.data.begin(), whole.data.begin() + 48 * 19 * 4));
      const Image tall = resample_undistorted(in, {5.5, 3, side / 4, 12, 48}, camera);
      ASSERT_EQ(tall.height, 48);
      for (int y = 0; y < 48; ++y)
        for (int x = 0; x < 12; ++x)
          for (int c = 0; c < 4; ++c) ASSERT_NEAR(tall.at(x, y)[c], whole.at(x, y)[c], 1e-6);
    }
}

}  // namespace
}  // namespace vsplat
