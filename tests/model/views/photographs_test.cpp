#include "model/views/photographs.h"

#include <gtest/gtest.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <map>

#include "model/networks/params/config.h"
#include "model/views/input.h"
#include "tests/support/picture_writers.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

// Counts how often files in a folder are opened, by any code.
class Opened {
 public:
  explicit Opened(const std::string& folder) : queue_(inotify_init1(IN_NONBLOCK)) {
    EXPECT_GE(inotify_add_watch(queue_, folder.c_str(), IN_OPEN), 0) << folder;
  }
  ~Opened() { ::close(queue_); }
  Opened(const Opened&) = delete;
  Opened& operator=(const Opened&) = delete;

  // The counts by name since the last call.
  std::map<std::string, int> times() const {
    std::map<std::string, int> out;
    alignas(inotify_event) char block[1 << 14];
    for (ssize_t n; (n = ::read(queue_, block, sizeof block)) > 0;)
      for (const char* at = block; at < block + n;) {
        const auto* event = reinterpret_cast<const inotify_event*>(at);
        if (event->len > 0) ++out[event->name];
        at += sizeof *event + event->len;
      }
    return out;
  }

 private:
  int queue_;
};

// A white disc of 60 pixels in the middle of 640 x 480; with four channels it is also the alpha.
Image disc(int channels) {
  Image out(640, 480, channels);
  for (int y = 210; y < 270; ++y)
    for (int x = 290; x < 350; ++x)
      if (std::hypot(x - 319.5, y - 239.5) < 30)
        for (int c = 0; c < channels; ++c) out.at(x, y)[c] = 1;
  return out;
}

Photographs ring_of(int count) {
  Photographs out;
  for (const Camera& camera : test::ring(count)) {
    ListedView view;
    view.camera = camera;
    view.name = view.camera.file;
    view.picture = camera.file;
    out.set.views.push_back(view);
  }
  return out;
}

TakenViews of_views(int views) {
  Config config;
  config.views = views;
  config.image = 32;
  return config.taken();
}

TEST(Photographs, EachFileOfAChosenViewIsOpenedOnceAndNoOther) {
  const TemporaryFolder folder;
  Photographs photographs = ring_of(4);
  for (int i = 0; i < 4; ++i) {
    ListedView& view = photographs.set.views[i];
    view.picture = folder / view.name;
    write_png(view.picture.string(), disc(i == 0 ? 4 : 3));
    if (i != 1) continue;
    view.mask = folder / "mask.png";
    write_png(view.mask->string(), disc(1));
  }
  const Opened opened(folder.string());
  for (const bool auto_frame : {false, true}) {
    InputRequest request;
    request.names = {"0", "1", "3"};
    request.placement.auto_frame = auto_frame;
    const Input input = prepare_input(photographs, of_views(4), request);
    const std::map<std::string, int> once = {{"0.png", 1}, {"1.png", 1}, {"3.png", 1}, {"mask.png", 1}};
    EXPECT_EQ(opened.times(), once) << auto_frame;
    if (auto_frame) {  // uses both extents
      EXPECT_NEAR(input.placement.edge, 1.2 * 2 * 60 / 790.0, 0.01);
    }
  }
}

TEST(Photographs, APictureIsMadeOnceForAView) {
  Photographs photographs = ring_of(3);
  for (ListedView& view : photographs.set.views) view.camera.width = view.camera.height = 0;  // taken from the picture
  std::map<int, int> made;
  photographs.picture = [&](int view) {
    ++made[view];
    return disc(4);
  };
  InputRequest request;
  request.placement.auto_frame = true;
  EXPECT_EQ(prepare_input(photographs, of_views(3), request).views.size(), 3U);
  const std::map<int, int> once = {{0, 1}, {1, 1}, {2, 1}};
  EXPECT_EQ(made, once);
}

// A whole picture with its mask, each decoded once however often it is requested; and which of them mark the object.
TEST(Photographs, AWholePictureComesWithItsMask) {
  const TemporaryFolder folder;
  Photographs photographs = ring_of(3);
  for (int i = 0; i < 3; ++i) {
    ListedView& view = photographs.set.views[i];
    view.picture = folder / view.name;
    write_png(view.picture.string(), disc(i == 0 ? 4 : 3));
  }
  photographs.set.views[1].mask = folder / "mask.png";
  write_png(folder / "mask.png", disc(1));
  const Opened opened(folder.string());
  for (int i = 0; i < 3; ++i) {
    LoadedPhotograph one(photographs, i);
    EXPECT_EQ(one.is_masked(), i < 2);
    const WholeView all = one.whole(0), small = one.whole(160);
    EXPECT_EQ(one.is_masked(), i < 2);
    ASSERT_EQ(all.image.width, 640);
    ASSERT_EQ(all.image.height, 480);
    EXPECT_EQ(all.image.at(0, 0)[3], i < 2 ? 0.0f : 1.0f);
    EXPECT_EQ(all.image.at(320, 240)[3], 1.0f);
    ASSERT_EQ(small.image.width, 160);
    ASSERT_EQ(small.image.height, 120);
    EXPECT_EQ(small.image.at(80, 60)[0], 1.0f);
    EXPECT_EQ(small.camera.fx, 200);
    EXPECT_EQ(small.camera.cy, 237.0 / 4);
  }
  const std::map<std::string, int> once = {{"0.png", 1}, {"1.png", 1}, {"2.png", 1}, {"mask.png", 1}};
  EXPECT_EQ(opened.times(), once);
  photographs.set.views[2].camera.width = 320;
  test::expect_error(Status::input, {folder / "2.png", "640 x 480"},
                     [&] { LoadedPhotograph(photographs, 2).whole(0); });
}

// A grey photograph, and a disc as its mask.
Photographs one_with_mask(const TemporaryFolder& folder) {
  Photographs out = ring_of(1);
  ListedView& view = out.set.views[0];
  view.picture = folder / "0.png";
  write_png(view.picture.string(), Image(640, 480, 3, 0.6f));
  view.mask = folder / "mask.png";
  write_png(folder / "mask.png", disc(1));
  return out;
}

// A mask that is ignored outside leaves the picture as it is, and says where something is known of it.
TEST(Photographs, AnIgnoredMaskMarksNoObject) {
  const TemporaryFolder folder;
  Photographs photographs = one_with_mask(folder);
  photographs.masks = MaskUse::ignore;
  const auto known = [&](int longest) {
    LoadedPhotograph one(photographs, 0);
    EXPECT_FALSE(one.is_masked());
    EXPECT_FALSE(one.shares());
    EXPECT_FALSE(one.extent());
    const WholeView whole = one.whole(longest);
    for (std::size_t i = 0; i < whole.image.data.size(); ++i)
      EXPECT_NEAR(whole.image.data[i], i % 4 == 3 ? 1 : 0.6, 0.01);
    double sum = 0;
    for (const float v : whole.known.data) sum += static_cast<double>(v);
    EXPECT_EQ(whole.known.at(whole.known.width / 2, whole.known.height / 2)[0], photographs.invert_masks ? 0 : 1);
    return sum;
  };
  const double inside = known(0);
  EXPECT_NEAR(inside, M_PI * 30 * 30, 30);
  EXPECT_LT(known(64), inside / 100);  // pixels on the edge are unknown
  photographs.invert_masks = true;
  EXPECT_EQ(known(0), 640 * 480 - inside);
  EXPECT_NEAR(known(64), 64 * 48 - inside / 100, 30);
}

TEST(Photographs, AnInvertedMaskShowsTheObjectInBlack) {
  const TemporaryFolder folder;
  Photographs photographs = one_with_mask(folder);
  const auto alpha = [&] { return LoadedPhotograph(photographs, 0).whole(0).image; };
  EXPECT_EQ(alpha().at(320, 240)[3], 1);
  EXPECT_EQ(alpha().at(0, 0)[3], 0);
  photographs.invert_masks = true;
  EXPECT_EQ(alpha().at(320, 240)[3], 0);
  EXPECT_EQ(alpha().at(0, 0)[3], 1);
}

TEST(Photographs, AMadePictureSaysByItsAlphaWhatTheObjectIs) {
  Photographs photographs = ring_of(2);
  photographs.picture = [](int view) { return disc(view == 0 ? 4 : 3); };
  EXPECT_TRUE(LoadedPhotograph(photographs, 0).is_masked());
  EXPECT_FALSE(LoadedPhotograph(photographs, 1).is_masked());
  EXPECT_EQ(LoadedPhotograph(photographs, 0).whole(64).image.width, 64);
}

TEST(Photographs, AreTurnedWhereTheListedSizeSaysSo) {
  const TemporaryFolder folder;
  Image stored(96, 64, 3);  // its left half is red
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 48; ++x) stored.at(x, y)[0] = 1;
  const std::string path = folder / "0.jpg";
  write_jpeg(path, stored, 95);
  test::add_exif_to_jpeg(path, test::exif_data(6));  // the stored left becomes the top
  const auto red_at = [&](int width, int height, double across, double down) {
    Photographs photographs = ring_of(1);
    ListedView& view = photographs.set.views[0];
    view.picture = path;
    view.camera.width = width, view.camera.height = height;
    view.camera.cx = 0.5 * width, view.camera.cy = 0.5 * height;
    EXPECT_EQ(resolved_view(photographs, 0).camera.height, height > width ? 96 : 64);
    LoadedPhotograph loaded(photographs, 0);
    EXPECT_EQ(loaded.listed().camera.width, height > width ? 64 : 96);
    const FramedView framed = loaded.framed({32, Crop::crop});
    return framed.image.at(static_cast<int>(32 * across), static_cast<int>(32 * down))[0] > 0.5f;
  };
  EXPECT_TRUE(red_at(64, 96, 0.5, 0.2));  // posed as displayed
  EXPECT_FALSE(red_at(64, 96, 0.5, 0.8));
  EXPECT_TRUE(red_at(96, 64, 0.2, 0.5));  // posed as stored
  EXPECT_FALSE(red_at(96, 64, 0.8, 0.5));
  EXPECT_TRUE(red_at(128, 192, 0.5, 0.2));  // and resized
}

TEST(Photographs, AnOrientationThatNothingTellsTheMeaningOfIsRefused) {
  const TemporaryFolder folder;
  ViewSet set;
  set.source = "transforms.json";
  ListedView view;
  view.picture = "a.jpg";
  const auto turning = [&](int width, int height, int orientation) {
    view.camera.width = width, view.camera.height = height;
    return turning_of(set, view, {96, 64, false, orientation});
  };
  const auto refused = [&](int width, int height, int orientation) {
    test::expect_error(Status::input, {"a.jpg", std::to_string(orientation), "EXIF", "transforms.json"},
                       [&] { turning(width, height, orientation); });
  };
  EXPECT_EQ(turning(0, 0, 1), 1);
  EXPECT_EQ(turning(64, 96, 1), 1);
  for (const int orientation : {5, 6, 7, 8}) {
    EXPECT_EQ(turning(96, 64, orientation), 1);
    EXPECT_EQ(turning(64, 96, orientation), orientation);
    refused(0, 0, orientation);
    refused(80, 80, orientation);
  }
  for (const int orientation : {2, 3, 4}) refused(96, 64, orientation);
  set.source = folder.string();  // a COLMAP model
  for (const int orientation : {2, 3, 4, 5, 6, 7, 8}) EXPECT_EQ(turning(96, 64, orientation), 1);
}

}  // namespace
}  // namespace vsplat
