#include "model/fit/fit_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>

#include "model/io/picture/image_file.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

constexpr int kFiles = 10, kFileWidth = 32, kFileHeight = 24;
constexpr std::size_t kFileBytes = std::size_t{4} * kFileWidth * kFileHeight;

// Picture files, each of its own grey.
class FitPicturesTest : public ::testing::Test {
 protected:
  FitPicturesTest() {
    for (int i = 0; i < kFiles; ++i) {
      const std::string path = folder_.path() + "/" + std::to_string(i) + ".png";
      write_png(path, Image(kFileWidth, kFileHeight, 3, static_cast<float>(i) / 255));
      ListedView view;
      view.camera.width = kFileWidth, view.camera.height = kFileHeight;
      view.camera.fx = view.camera.fy = 30 + i;
      view.camera.cx = kFileWidth / 2.0, view.camera.cy = kFileHeight / 2.0;
      view.name = std::to_string(i);
      view.picture = path;
      photographs_.set.views.push_back(view);
    }
  }

  static void expect_picture(const FitPicture& picture, int view) {
    for (std::size_t i = 0; i < picture.rgba.size(); ++i) ASSERT_EQ(picture.rgba[i], i % 4 < 3 ? view : 255);
  }

  test::TemporaryFolder folder_;
  Photographs photographs_;
};

TEST_F(FitPicturesTest, TheCacheNeverHoldsMoreThanItsCap) {
  for (const std::size_t cap : {std::size_t{0}, 3 * kFileBytes + 1, 100 * kFileBytes}) {
    FitPictures pictures(photographs_, {}, 0, cap);
    for (int i = 0; i < 3 * kFiles; ++i) {
      const int view = 7 * i % kFiles;
      expect_picture(*pictures.at(view), view);
      EXPECT_LE(pictures.bytes(), std::max(cap, kFileBytes));
      pictures.read_ahead({7 * (i + 1) % kFiles, 7 * (i + 2) % kFiles});
    }
    EXPECT_LE(pictures.most_ahead(), 1 + cap / (10 * kFileBytes));
    EXPECT_EQ(pictures.bytes(), std::min(std::max(cap / kFileBytes, std::size_t{1}), std::size_t{kFiles}) * kFileBytes);
    pictures.limit(2 * kFileBytes);
    EXPECT_LE(pictures.bytes(), 2 * kFileBytes);
  }
}

TEST_F(FitPicturesTest, AnotherPictureThanTheOneReadAhead) {
  FitPictures pictures(photographs_, {}, 0, kFileBytes);
  pictures.read_ahead({1});
  expect_picture(*pictures.at(2), 2);
  pictures.read_ahead({3});
  pictures.read_ahead({4, 5});
  expect_picture(*pictures.at(4), 4);
  expect_picture(*pictures.at(3), 3);
  EXPECT_EQ(pictures.bytes(), kFileBytes);
}

// A fit asks for cameras after its end, when its pictures may no longer be in memory.
TEST_F(FitPicturesTest, ACameraIsDecodedOnce) {
  FitPictures pictures(photographs_, {}, 0, 0);
  for (int view = 0; view < kFiles; ++view) EXPECT_EQ(pictures.camera(view).fx, 30 + view);
  for (const ListedView& view : photographs_.set.views) std::filesystem::remove(view.picture);
  for (int view = 0; view < kFiles; ++view) EXPECT_EQ(pictures.camera(view).fx, 30 + view);
}

}  // namespace
}  // namespace vsplat
