#include "model/io/picture/contact_sheet.h"

#include "model/io/picture/text.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

constexpr int margin = ContactSheet::margin;

Image filled(int width, int height, float r, float g, float b) {
  Image out(width, height, 3);
  for (std::size_t i = 0; i < out.data.size(); i += 3) out.data[i] = r, out.data[i + 1] = g, out.data[i + 2] = b;
  return out;
}

TEST(Shrunk, IsTheMeanOverEachPixelsArea) {
  Image in(5, 3, 1);
  for (int y = 0; y < 3; ++y)
    for (int x = 0; x < 5; ++x) *in.at(x, y) = static_cast<float>(x + 10 * y);
  const Image out = shrunk(in, 2, 2);  // 2.5 x 1.5 pixels each
  EXPECT_NEAR(*out.at(0, 0), (0 + 1 + 0.5 * 2) / 2.5 + 10 * (0 + 0.5 * 1) / 1.5, 1e-6);
  EXPECT_NEAR(*out.at(1, 1), (0.5 * 2 + 3 + 4) / 2.5 + 10 * (0.5 * 1 + 2) / 1.5, 1e-5);
  EXPECT_EQ(shrunk(in, 5, 3).data, in.data);
  double sum = 0, before = 0;
  for (const float v : shrunk(in, 3, 2).data) sum += v / 6;
  for (const float v : in.data) before += v / 15;
  EXPECT_NEAR(sum, before, 1e-5);
}

TEST(ContactSheet, HasEveryPictureInItsPlace) {
  SheetOptions options;
  options.cell = 20;
  options.columns = 3;
  ContactSheet sheet(options);
  for (int i = 0; i < 5; ++i) sheet.add(filled(40, 30, 0.1f * static_cast<float>(i), 0.5f, 2.0f));
  const Image out = sheet.sheet();
  EXPECT_EQ(out.width, 3 * 20 + 4 * margin);
  EXPECT_EQ(out.height, 2 * 15 + 3 * margin);
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const int column = x / (20 + margin), row = y / (15 + margin), i = 3 * row + column;
      const bool inside = x % (20 + margin) >= margin && y % (15 + margin) >= margin && i < 5;
      EXPECT_NEAR(out.at(x, y)[0], inside ? 0.1f * static_cast<float>(i) : ContactSheet::paper, 1e-6) << x << " " << y;
      EXPECT_NEAR(out.at(x, y)[2], inside ? 1.0f : ContactSheet::paper, 1e-6);
    }
}

TEST(ContactSheet, CentresSmallerPicturesAndEnlargesNone) {
  SheetOptions options;
  options.columns = 2;
  ContactSheet sheet(options);
  sheet.add(filled(101, 61, 0, 0, 0));
  sheet.add(filled(5, 3, 1, 0, 0));
  const Image out = sheet.sheet();
  EXPECT_EQ(out.width, 2 * 101 + 3 * margin);
  EXPECT_EQ(out.height, 61 + 2 * margin);
  // The second cell is centred: equal margins at left and right, above and below.
  const int left = 2 * margin + 101 + (101 - 5) / 2, top = margin + (61 - 3) / 2;
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < out.width; ++x) {
      const bool first = x >= margin && x < margin + 101 && y >= margin && y < margin + 61;
      const bool second = x >= left && x < left + 5 && y >= top && y < top + 3;
      ASSERT_EQ(out.at(x, y)[0], first ? 0.0f : second ? 1.0f : ContactSheet::paper) << x << " " << y;
      ASSERT_EQ(out.at(x, y)[1], first || second ? 0.0f : ContactSheet::paper) << x << " " << y;
    }
}

// If any picture has a label, there is space for one below every picture; the text is dark on the background and inside
// its cell.
TEST(ContactSheet, LabelsStandBelowThePictures) {
  SheetOptions options;
  options.columns = 2;
  ContactSheet sheet(options);
  sheet.add(Image(40, 20, 3, 1.0f), "0001");
  sheet.add(Image(40, 20, 3, 1.0f));
  sheet.add(Image(40, 20, 3, 1.0f), "far too long for it");
  const Image out = sheet.sheet();
  ASSERT_EQ(out.width, 2 * 40 + 3 * margin);
  ASSERT_EQ(out.height, 2 * (20 + ContactSheet::label_height) + 3 * margin);
  const auto dark = [&](int x0, int y0, int w, int h) {
    int count = 0;
    for (int y = y0; y < y0 + h; ++y)
      for (int x = x0; x < x0 + w; ++x) count += out.at(x, y)[0] < 0.5f;
    return count;
  };
  EXPECT_GT(dark(margin, margin + 20, 40, ContactSheet::label_height), 30);
  EXPECT_EQ(dark(2 * margin + 40, margin + 20, 40, ContactSheet::label_height), 0);
  const int below = 2 * margin + 40 + ContactSheet::label_height;
  EXPECT_GT(dark(margin, below, 40, ContactSheet::label_height), 30);
  EXPECT_EQ(dark(0, 0, out.width, out.height), dark(margin, margin + 20, 40, ContactSheet::label_height) +
                                                   dark(margin, below, 40, ContactSheet::label_height));
}

TEST(Text, IsCutAndStaysInThePicture) {
  EXPECT_EQ(fitted_text("0123456", 42), "0123456");
  EXPECT_EQ(fitted_text("0123456", 41), "0123..");
  EXPECT_EQ(fitted_text("0123456", 5), "");
  Image picture(30, 10, 3, 1.0f);
  draw_text(picture, 0, 0, "L", 0);
  for (int y = 0; y < 7; ++y) EXPECT_EQ(picture.at(0, y + 1)[2], 0.0f) << y;  // the stroke on its left
  EXPECT_EQ(picture.at(1, 1)[0], 1.0f);
  EXPECT_EQ(picture.at(4, 7)[0], 0.0f);  // and the one below
  const Image before = picture;
  draw_text(picture, -100, -3, "LLL", 0);
  draw_text(picture, 100, 5, "LLL", 0);
  EXPECT_EQ(picture.data, before.data);
  Image question(6, 10, 3, 1.0f), other = question;
  draw_text(question, 0, 0, "?", 0);
  draw_text(other, 0, 0, "\xe9", 0);
  EXPECT_EQ(question.data, other.data);
}

TEST(ContactSheet, IsBalancedAndBounded) {
  for (const int count : {1, 2, 7, 24, 100, 1000}) {
    SheetOptions options;
    options.expected = count;
    ContactSheet sheet(options);
    for (int i = 0; i < count; ++i) sheet.add(filled(300, 300, 0.5f, 0.5f, 0.5f));
    const Image out = sheet.sheet();
    EXPECT_LT(static_cast<double>(out.width) * out.height, 24e6);
    if (count >= 24) {
      EXPECT_GT(static_cast<double>(out.width) / out.height, 1.0);
      EXPECT_LT(static_cast<double>(out.width) / out.height, 1.8);
    }
  }
}

TEST(ContactSheet, RefusesWhatItCannotDo) {
  test::expect_error(Status::usage, {"no pictures"}, [] { ContactSheet({}).sheet(); });
  SheetOptions options;
  options.cell = 5000;
  test::expect_error(Status::usage, {"5000"}, [&] { ContactSheet{options}; });
  options.cell = 2000;
  options.columns = 40;
  ContactSheet sheet(options);
  for (int i = 0; i < 40; ++i) sheet.add(Image(2000, 4, 3));
  test::expect_error(Status::input, {"40 pictures", "pixels"}, [&] { sheet.sheet(); });
}

}  // namespace
}  // namespace vsplat
