// Pictures row by row: the host memory used, and that the largest pictures need little.
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <random>

#include "model/base/resample.h"
#include "model/io/picture/image_file.h"
#include "model/views/photographs.h"
#include "runtime/system/host_memory.h"
#include "tests/support/image_writers.h"
#include "tests/support/picture_writers.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

class PictureRows : public testing::Test {
 protected:
  ~PictureRows() override { set_host_memory_limit(0); }

  template <class T>
  std::vector<T> noise(int channels, int largest) {
    std::vector<T> out(static_cast<std::size_t>(w) * h * channels);
    for (T& v : out) v = static_cast<T>(rng_() % (largest + 1));
    return out;
  }
  // One file of each kind, last those that need the whole picture.
  std::vector<std::string> files() {
    const auto bytes = noise<std::uint8_t>(3, 255);
    const std::vector<std::uint16_t> samples(bytes.begin(), bytes.end()), wide = noise<std::uint16_t>(4, 65535);
    write_test_png(folder_ / "a.png", w, h, wide, {.colour_type = PNG_COLOR_TYPE_RGB_ALPHA, .depth = 16});
    write_test_jpeg(folder_ / "a.jpg", w, h, 3, bytes);
    Image colour(w, h, 3, 0.25f);
    write_exr(folder_ / "a.exr", colour, Image(w, h, 1, 1.0f), Image(w, h, 1, 1.0f));
    test::write_test_tiff(folder_ / "strips.tif", w, h, 3, samples, {.depth = 8});
    test::write_test_tiff(folder_ / "tiles.tif", w, h, 3, samples, {.depth = 8, .tiled = true});
    test::write_test_tiff(folder_ / "planes.tif", w, h, 3, samples, {.depth = 8, .planes = true});
    test::write_test_bmp(folder_ / "a.bmp", w, h, 3, bytes);
    test::write_test_webp(folder_ / "a.webp", w, h, 3, bytes);
    write_test_jpeg(folder_ / "progressive.jpg", w, h, 3, bytes, true);
    write_test_png(folder_ / "interlaced.png", w, h, wide,
                   {.colour_type = PNG_COLOR_TYPE_RGB_ALPHA, .depth = 16, .interlaced = true});
    return {"a.png",      "a.jpg", "a.exr",  "strips.tif",      "tiles.tif",
            "planes.tif", "a.bmp", "a.webp", "progressive.jpg", "interlaced.png"};
  }

  static constexpr int w = 61, h = 301;  // more rows than are decoded at once
  test::TemporaryFolder folder_;
  std::mt19937 rng_{7};
};

TEST_F(PictureRows, AreTheWholePicture) {
  for (const std::string& name : files()) {
    const ImageFile file(folder_ / name);
    const Image whole = read_image(folder_ / name);
    for (int orientation = 1; orientation <= 8; ++orientation) {
      const auto rows = file.rows(orientation);
      ASSERT_EQ(rows->width, orientation >= 5 ? h : w) << name;
      ASSERT_EQ(rows->channels, whole.channels) << name;
      if (orientation == 1) {
        EXPECT_EQ(image_of(*rows).data, whole.data) << name;
      }
    }
    EXPECT_EQ(reserved_host_memory(), 0u) << name;
  }
}

TEST_F(PictureRows, TakeLittleOfTheBudgetUnlessTheFormatNeedsAll) {
  const std::vector<std::string> names = files();
  for (const std::string& name : names) {
    const bool by_rows = name == "a.png" || name == "a.jpg";
    const ImageFile file(folder_ / name);
    EXPECT_EQ(file.info().held == 0, by_rows) << name;
    set_host_memory_limit(64);
    if (by_rows) {
      std::vector<float> row(file.rows()->row_size());
      file.rows()->next(row.data());
    } else {
      test::expect_error(Status::memory, {name, "61 x 301", "GiB are left"}, [&] { (void)file.rows(); });
    }
    test::expect_error(Status::memory, {name, "61 x 301"}, [&] { (void)file.decode(); });
    if (by_rows) test::expect_error(Status::memory, {name}, [&] { (void)file.rows(6); });
    set_host_memory_limit(0);
  }
}

TEST_F(PictureRows, AJpegThatGoesOverItsPixelsForEverIsRefused) {
  write_jpeg_of_many_scans(folder_ / "a.jpg", 64);
  test::expect_error(Status::format, {"a.jpg", "more than 100 scans"}, [&] { read_image(folder_ / "a.jpg"); });
}

TEST_F(PictureRows, CutBelowTheWindowAreFoundOut) {
  const auto samples = noise<std::uint16_t>(3, 255);
  write_test_png(folder_ / "a.png", w, h, samples, {.colour_type = PNG_COLOR_TYPE_RGB});
  const std::uintmax_t size = std::filesystem::file_size(folder_ / "a.png");
  std::filesystem::resize_file(folder_ / "a.png", size * 9 / 10);
  const ImageFile file(folder_ / "a.png");
  const auto rows = file.rows();
  PremultipliedRows source(*rows);
  test::expect_error(Status::format, {"a.png", "cut-off"}, [&] { (void)resample(source, {0, 0, 32, 32}); });
}

// A photograph too large to be cached decoded gives the same views, with only some rows in memory.
TEST_F(PictureRows, ALargePhotographIsNeverHeldWhole) {
  constexpr int side = 4099;  // 16.8 million pixels
  Image small(side, side, 3);
  for (std::size_t i = 0; i < small.data.size(); ++i) small.data[i] = static_cast<float>(i * 2654435761u % 251) / 255;
  write_png(folder_ / "a.png", small);
  Camera camera;
  camera.fx = camera.fy = side, camera.cx = camera.cy = 0.5 * side;
  camera.width = camera.height = side;
  for (const double k1 : {0.0, 0.05}) {
    if (k1 > 0) camera.distortion = {Distortion::Model::opencv, {k1}};
    Photographs photographs;
    photographs.set.views.push_back({});
    photographs.set.views[0].camera = camera;
    photographs.set.views[0].picture = folder_ / "a.png";
    set_host_memory_limit(std::size_t{1} << 20);
    const WholeView view = LoadedPhotograph(photographs, 0).whole(100);
    set_host_memory_limit(0);
    const WholeView expected = whole_view(camera, small, nullptr, 100, {"a", ""});
    ASSERT_EQ(view.image.data.size(), expected.image.data.size());
    EXPECT_EQ(view.image.data, expected.image.data) << k1;
  }
}

}  // namespace
}  // namespace vsplat
