#include "model/fit/fit_picture.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

FitPicture picture(int width, int height) {
  FitPicture out;
  out.name = "a";
  out.camera.width = width, out.camera.height = height;
  out.camera.fx = 10, out.camera.fy = 12, out.camera.cx = 3, out.camera.cy = 4;
  for (int i = 0; i < width * height; ++i) {
    for (int c = 0; c < 4; ++c) out.rgba.push_back(static_cast<std::uint8_t>(i + c));
    out.known.push_back(i == 2 ? 0 : 1);
  }
  out.masked = true;
  return out;
}

// Against a count of the definition.
TEST(FitPicture, WindowsAreKnownWhereAPixelIs) {
  for (const int of : {1, 40, 150, 400, 5000}) {
    FitPicture p = picture(23, 17);
    for (std::size_t i = 0; i < p.known.size(); ++i) p.known[i] = (7 * i + 5) % static_cast<std::size_t>(of) == 0;
    int want = 0;
    for (int y = 0; y < 7; ++y)
      for (int x = 0; x < 13; ++x) {
        bool any = false;
        for (int i = 0; i < 121; ++i)
          any =
              any || p.known.at(static_cast<std::size_t>(y + i / 11) * 23 + static_cast<std::size_t>(x + i % 11)) != 0;
        want += any ? 1 : 0;
      }
    EXPECT_DOUBLE_EQ(known_window_share(p.known, 23, 17), want / 91.0) << of;
  }
  EXPECT_EQ(known_window_share(picture(10, 30).known, 10, 30), 1);
}

}  // namespace
}  // namespace vsplat
