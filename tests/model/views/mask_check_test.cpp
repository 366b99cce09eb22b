#include "model/views/mask_check.h"

#include "model/base/resample.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

// White inside a box, or everywhere except in the box.
Image box(int size, int from, int to, bool inverted = false) {
  Image out(size, size, 1);
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x)
      *out.at(x, y) = (x >= from && x < to && y >= from && y < to) != inverted ? 1.0f : 0.0f;
  return out;
}

MaskShares shares_of(const Image& mask) {
  ImageRows rows(mask);
  return mask_shares(rows);
}

TEST(MaskCheck, Shares) {
  const MaskShares shares = shares_of(box(10, 0, 5));
  EXPECT_NEAR(shares.all, 0.25, 1e-12);
  EXPECT_NEAR(shares.border, 9.0 / 36, 1e-12);
  EXPECT_EQ(shares.brightest, 1.0f);
}

TEST(MaskCheck, InvertedMasksAreWarnedOf) {
  const auto warned = [](const std::vector<MaskShares>& masks) {
    const test::Warnings warnings;
    check_masks("set", masks, masks.size());
    return !warnings.all.empty() && warnings.all[0].find("inverted") != std::string::npos;
  };
  const MaskShares good = shares_of(box(20, 5, 15)), inverted = shares_of(box(20, 5, 15, true));
  EXPECT_TRUE(warned({inverted, inverted, good}));
  EXPECT_FALSE(warned({inverted, good, good}));
  EXPECT_FALSE(warned({shares_of(box(20, 0, 20))})) << "all white";
  EXPECT_FALSE(warned({shares_of(box(20, 0, 18))})) << "an object that fills the picture";
  EXPECT_FALSE(warned({}));
}

TEST(MaskCheck, BlackMasksAreRefused) {
  const MaskShares black = shares_of(box(20, 0, 0)), good = shares_of(box(20, 5, 15));
  check_masks("set", std::vector{black, good}, 2);  // one view may not show the object
  test::expect_error(Status::input, {"set", "all 2 views", "black", "white is the object"}, [&] {
    check_masks("set", std::vector{black, black}, 2);
  });
  Image ones = box(20, 5, 15);
  for (float& v : ones.data) v /= 255;
  test::expect_error(Status::input, {"brightest value is 1 of 255"},
                     [&] { check_masks("set", std::vector{shares_of(ones)}, 1); });
}

TEST(MaskCheck, ViewsWithoutAMaskAreCounted) {
  test::Warnings warnings;
  const MaskShares good = shares_of(box(10, 3, 7));
  check_masks("set", std::vector{good, good}, 2);
  check_masks("set", {}, 4);
  EXPECT_EQ(warnings.text(), "");
  check_masks("set", std::vector{good, good, good}, 4);
  EXPECT_NE(warnings.text().find("3 of the 4 views"), std::string::npos) << warnings.text();
}

TEST(MaskCheck, ResizedRowsKeepWhatIsThere) {
  const Image mask = box(16, 4, 12);
  for (const auto& [width, height] : {std::pair{8, 8}, {32, 32}, {16, 16}, {15, 17}}) {
    ImageRows from(mask);
    ResizedRows rows(from, width, height);
    const Image out = image_of(rows);
    double sum = 0;
    for (const float v : out.data) sum += v;
    EXPECT_NEAR(sum / (width * height), 0.25, 0.02) << width;
    EXPECT_NEAR(*out.at(width / 2, height / 2), 1, 1e-6);
    EXPECT_NEAR(*out.at(0, height / 2), 0, 1e-6);
  }
  ImageRows from(mask);
  ResizedRows same(from, 16, 16);
  EXPECT_EQ(image_of(same).data, mask.data);
}

TEST(MaskCheck, SameShapes) {
  EXPECT_TRUE(is_same_shape(128, 128, 256, 256));
  EXPECT_TRUE(is_same_shape(128, 85, 256, 171));
  EXPECT_TRUE(is_same_shape(4000, 3000, 1000, 750));
  EXPECT_FALSE(is_same_shape(256, 200, 256, 256));
  EXPECT_FALSE(is_same_shape(256, 192, 192, 256));
}

}  // namespace
}  // namespace vsplat
