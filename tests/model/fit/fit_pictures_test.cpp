#include "model/fit/fit_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <thread>

#include "model/io/picture/image_file.h"
#include "runtime/clock.h"
#include "runtime/host_span.h"
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

// Each is decoded once, by a thread of its own, as far as most_ahead() says, and whether or not it is asked for.
TEST_F(FitPicturesTest, SeveralPicturesAreDecodedAhead) {
  HostLog& log = HostLog::of_process();
  log.hold();
  const std::uint64_t begun = now_ns();
  std::size_t most = 0;
  {
    FitPictures pictures(photographs_, {}, 0, 100 * kFileBytes);
    (void)pictures.at(0);
    most = pictures.most_ahead();
    EXPECT_EQ(most, std::min(std::max(std::thread::hardware_concurrency(), 1u), 8u));
    pictures.read_ahead({1, 2, 3, 4, 5, 6, 7, 8, 9});
    pictures.read_ahead({1, 2, 3, 4, 5, 6, 7, 8, 9});
    expect_picture(*pictures.at(1), 1);
  }
  std::multiset<std::string> decoded;
  std::set<int> threads;
  for (const HostRecord& span : log.since(begun))
    if (span.name == "decode pictures") {
      decoded.insert(span.detail);
      threads.insert(span.thread);
    }
  log.let_go();
  EXPECT_EQ(decoded.size(), 1 + most);
  for (std::size_t view = 0; view <= most; ++view) EXPECT_EQ(decoded.count(std::to_string(view)), 1u) << view;
  EXPECT_EQ(threads.size(), 1 + most);
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
