#include "model/io/picture/image_file.h"

#include <ImfFrameBuffer.h>
#include <ImfInputFile.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "model/io/picture/image_formats.h"
#include "runtime/error.h"
#include "runtime/files/file.h"
#include "tests/support/damaged_pictures.h"
#include "tests/support/image_writers.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

std::vector<std::uint16_t> random_samples(std::size_t count, int largest, unsigned seed) {
  std::mt19937 rng(seed);
  std::vector<std::uint16_t> out(count);
  for (auto& v : out) v = static_cast<std::uint16_t>(rng() % (largest + 1));
  return out;
}

// Smooth colours, which JPEG keeps.
std::vector<std::uint8_t> smooth_samples(int width, int height, int channels) {
  std::vector<std::uint8_t> out;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c) out.push_back(static_cast<std::uint8_t>(60 + 4 * x + 3 * y + 20 * c));
  return out;
}

void expect_error(Status status, const std::string& path, const std::string& words) {
  test::expect_error(status, {path, words}, [&] { read_image(path); });
}

void write_bytes(const std::string& path, const std::vector<unsigned char>& bytes) {
  write_file(path, bytes.data(), bytes.size());
}

TEST(PngIn, ReadsEveryKindAndDepth) {
  const TemporaryFolder folder;
  const int w = 13, h = 7;
  struct Case {
    int type, depth, stored;
  };
  for (const bool interlaced : {false, true})
    for (const Case& c :
         {Case{PNG_COLOR_TYPE_GRAY, 1, 1}, Case{PNG_COLOR_TYPE_GRAY, 2, 1}, Case{PNG_COLOR_TYPE_GRAY, 4, 1},
          Case{PNG_COLOR_TYPE_GRAY, 8, 1}, Case{PNG_COLOR_TYPE_GRAY, 16, 1}, Case{PNG_COLOR_TYPE_GRAY_ALPHA, 8, 2},
          Case{PNG_COLOR_TYPE_GRAY_ALPHA, 16, 2}, Case{PNG_COLOR_TYPE_RGB, 8, 3}, Case{PNG_COLOR_TYPE_RGB, 16, 3},
          Case{PNG_COLOR_TYPE_RGB_ALPHA, 8, 4}, Case{PNG_COLOR_TYPE_RGB_ALPHA, 16, 4}}) {
      SCOPED_TRACE(testing::Message() << "type " << c.type << ", depth " << c.depth << ", interlaced " << interlaced);
      const int largest = (1 << c.depth) - 1;
      const auto samples = random_samples(static_cast<std::size_t>(w) * h * c.stored, largest, c.type * 100 + c.depth);
      write_test_png(folder / "a.png", w, h, samples,
                     {.colour_type = c.type, .depth = c.depth, .interlaced = interlaced});
      const ImageInfo info = read_image_info(folder / "a.png");
      EXPECT_EQ(info.width, w);
      EXPECT_EQ(info.height, h);
      EXPECT_EQ(info.alpha, c.stored % 2 == 0);
      const Image image = read_image(folder / "a.png");
      ASSERT_EQ(image.width, w);
      ASSERT_EQ(image.height, h);
      ASSERT_EQ(image.channels, c.stored % 2 == 0 ? 4 : 3);
      for (int i = 0; i < w * h; ++i) {
        const auto sample = [&](int k) {
          return static_cast<float>(samples[i * c.stored + k]) / static_cast<float>(largest);
        };
        for (int k = 0; k < 3; ++k) ASSERT_FLOAT_EQ(image.data[i * image.channels + k], sample(c.stored >= 3 ? k : 0));
        const float alpha = image.channels == 4 ? image.data[i * 4 + 3] : 1.0f;
        ASSERT_FLOAT_EQ(alpha, image.channels == 4 ? sample(c.stored - 1) : 1.0f);
      }
    }
}

TEST(PngIn, ReadsPalettesWithAndWithoutTransparency) {
  const TemporaryFolder folder;
  const std::vector<std::uint16_t> samples = {0, 1, 2, 2, 1, 0};
  PngKind kind{.colour_type = PNG_COLOR_TYPE_PALETTE, .depth = 2, .palette = {255, 0, 0, 0, 51, 0, 0, 0, 102}};
  write_test_png(folder / "a.png", 3, 2, samples, kind);
  const Image plain = read_image(folder / "a.png");
  ASSERT_EQ(plain.channels, 3);
  EXPECT_FALSE(read_image_info(folder / "a.png").alpha);
  EXPECT_FLOAT_EQ(plain.at(0, 0)[0], 1.0f);
  EXPECT_FLOAT_EQ(plain.at(1, 0)[1], 0.2f);
  EXPECT_FLOAT_EQ(plain.at(0, 1)[2], 0.4f);
  kind.palette_alpha = {0, 153};
  write_test_png(folder / "b.png", 3, 2, samples, kind);
  const Image seen = read_image(folder / "b.png");
  ASSERT_EQ(seen.channels, 4);
  EXPECT_TRUE(read_image_info(folder / "b.png").alpha);
  EXPECT_FLOAT_EQ(seen.at(0, 0)[3], 0.0f);
  EXPECT_FLOAT_EQ(seen.at(1, 0)[3], 0.6f);
  EXPECT_FLOAT_EQ(seen.at(2, 0)[3], 1.0f);
}

// Bytes that this process has read from files so far.
long bytes_read() {
  std::ifstream in("/proc/self/io");
  std::string name;
  long count = -1;
  in >> name >> count;
  EXPECT_EQ(name, "rchar:");
  return count;
}

TEST(PictureHeaders, AreReadWithoutTheRestOfTheFile) {
  const TemporaryFolder folder;
  Image picture(5, 3, 4);
  write_png(folder / "a.png", picture);
  write_exr(folder / "a.exr", Image(5, 3, 3), Image(5, 3, 1), Image(5, 3, 1));
  write_jpeg(folder / "a.jpg", Image(5, 3, 3), 90);
  for (const char* name : {"a.png", "a.exr", "a.jpg"}) {
    std::filesystem::resize_file(folder / name, 1 << 26);
    const long before = bytes_read();
    const ImageInfo info = read_image_info(folder / name);
    EXPECT_LT(bytes_read() - before, 1 << 17) << name;
    EXPECT_EQ(info.width, 5) << name;
    EXPECT_EQ(info.height, 3) << name;
    EXPECT_EQ(info.alpha, std::string(name) != "a.jpg") << name;
  }
}

TEST(PictureHeaders, MayBeLong) {
  const TemporaryFolder folder;
  write_jpeg(folder / "a.jpg", Image(5, 3, 3), 90);
  const std::vector<unsigned char> bytes = read_file(folder / "a.jpg");
  std::vector<unsigned char> tags;  // as cameras write them: thumbnails, colour profiles
  for (int i = 0; i < 20; ++i) {
    tags.insert(tags.end(), {0xff, 0xe1, 0xff, 0xff});
    tags.resize(tags.size() + 0xffff - 2, 7);
  }
  std::vector<unsigned char> tagged = bytes;
  tagged.insert(tagged.begin() + 2, tags.begin(), tags.end());
  write_bytes(folder / "b.jpg", tagged);
  EXPECT_EQ(read_image_info(folder / "b.jpg").width, 5);
  tagged.resize(tags.size());  // cut off within the header
  write_bytes(folder / "c.jpg", tagged);
  EXPECT_THROW(read_image_info(folder / "c.jpg"), Error);
}

TEST(PngIn, ReadsATransparentColour) {
  const TemporaryFolder folder;
  write_test_png(folder / "grey.png", 2, 1, {7, 8}, {.colour_type = PNG_COLOR_TYPE_GRAY, .transparent = {7}});
  EXPECT_TRUE(read_image_info(folder / "grey.png").alpha);
  const Image grey = read_image(folder / "grey.png");
  ASSERT_EQ(grey.channels, 4);
  EXPECT_EQ(grey.at(0, 0)[3], 0.0f);
  EXPECT_EQ(grey.at(1, 0)[3], 1.0f);
  write_test_png(folder / "rgb.png", 2, 1, {1000, 2000, 3000, 1000, 2000, 3001},
                 {.colour_type = PNG_COLOR_TYPE_RGB, .depth = 16, .transparent = {1000, 2000, 3000}});
  const Image rgb = read_image(folder / "rgb.png");
  ASSERT_EQ(rgb.channels, 4);
  EXPECT_EQ(rgb.at(0, 0)[3], 0.0f);
  EXPECT_EQ(rgb.at(1, 0)[3], 1.0f);
}

TEST(PngOut, RoundsAndClampsAndReadsBack) {
  const TemporaryFolder folder;
  Image image(4, 1, 3);
  image.data = {0.0f,
                1.0f,
                0.5f,
                -1.0f,
                2.0f,
                0.2f,
                0.499f / 255,
                0.501f / 255,
                254.499f / 255,
                std::nanf(""),
                std::numeric_limits<float>::infinity(),
                254.501f / 255};
  write_png(folder / "a.png", image);
  const Image back = read_image(folder / "a.png");
  const int want[] = {0, 255, 128, 0, 255, 51, 0, 1, 254, 0, 255, 255};
  ASSERT_EQ(back.data.size(), 12u);
  for (int i = 0; i < 12; ++i) EXPECT_EQ(std::lround(back.data[i] * 255), want[i]) << i;
  Image grey(5, 3, 1);
  for (int i = 0; i < 15; ++i) grey.data[i] = static_cast<float>(i * 17) / 255.0f;
  write_png(folder / "g.png", grey);
  EXPECT_EQ(read_mask(folder / "g.png").data, grey.data);
  // Writing twice gives the same file.
  write_png(folder / "h.png", grey);
  EXPECT_EQ(read_file(folder / "g.png"), read_file(folder / "h.png"));
}

TEST(Output, LeavesNothingWhereItFails) {
  const TemporaryFolder folder;
  const Image image(2, 2, 3);
  std::filesystem::create_directory(folder / "taken.png");
  for (const std::string& path : {folder / "no/such/a.png", folder / "taken.png"}) {
    test::expect_error(Status::file, {path}, [&] { write_png(path, image); });
  }
  std::size_t entries = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder.string())) ++entries;
  EXPECT_EQ(entries, 1u);
}

TEST(JpegIn, ReadsGreyAndColour) {
  const TemporaryFolder folder;
  const int w = 21, h = 18;
  for (const int channels : {1, 3})
    for (const bool progressive : {false, true}) {
      const auto samples = smooth_samples(w, h, channels);
      write_test_jpeg(folder / "a.jpg", w, h, channels, samples, progressive);
      const Image image = read_image(folder / "a.jpg");
      ASSERT_EQ(image.width, w);
      ASSERT_EQ(image.height, h);
      ASSERT_EQ(image.channels, 3);
      EXPECT_EQ(read_image_info(folder / "a.jpg").height, h);
      double worst = 0;
      for (int i = 0; i < w * h; ++i)
        for (int k = 0; k < 3; ++k)
          worst = std::max(worst,
                           std::abs(255.0 * image.data[i * 3 + k] - samples[i * channels + (channels == 3 ? k : 0)]));
      EXPECT_LE(worst, 8);
    }
}

TEST(JpegIn, RefusesCmykByName) {
  const TemporaryFolder folder;
  write_test_jpeg(folder / "a.jpg", 8, 8, 4, std::vector<std::uint8_t>(256, 100));
  expect_error(Status::format, folder / "a.jpg", "CMYK");
}

TEST(JpegOut, IsReadBackNearlyTheSame) {
  const TemporaryFolder folder;
  Image in(37, 21, 3);
  const std::vector<std::uint8_t> samples = smooth_samples(37, 21, 3);
  for (std::size_t i = 0; i < samples.size(); ++i) in.data[i] = samples[i] / 255.0f;
  in.at(5, 7)[0] = 1, in.at(5, 7)[1] = in.at(5, 7)[2] = 0;  // a red dot, which half the chroma resolution would smear
  std::size_t before = 0;
  for (const int quality : {30, 90, 100}) {
    write_jpeg(folder / "a.jpg", in, quality);
    const Image out = read_image(folder / "a.jpg");
    ASSERT_EQ(out.data.size(), in.data.size());
    double mean = 0;
    for (std::size_t i = 0; i < in.data.size(); ++i)
      mean += std::abs(out.data[i] - in.data[i]) / static_cast<double>(in.data.size());
    EXPECT_LT(mean, quality == 30 ? 0.03 : 0.01);
    EXPECT_GT(out.at(5, 7)[0] - out.at(5, 7)[1], quality == 30 ? 0.0 : 0.7);
    const std::size_t size = test::contents_of(folder / "a.jpg").size();
    EXPECT_GT(size, before);
    before = size;
  }
}

TEST(JpegOut, RefusesWhatItCannotHold) {
  const TemporaryFolder folder;
  for (const int quality : {0, 101, -1}) EXPECT_THROW(write_jpeg(folder / "a.jpg", Image(2, 2, 3), quality), Error);
  EXPECT_THROW(write_jpeg(folder / "a.jpg", Image(65501, 1, 3), 90), Error);
  EXPECT_TRUE(folder.entries().empty());
}

TEST(ExrIn, DividesByAlphaAndEncodes) {
  const TemporaryFolder folder;
  const int w = 19, h = 11;
  std::mt19937 rng(3);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<std::vector<float>> planes(4, std::vector<float>(w * h));
  for (int i = 0; i < w * h; ++i) {
    const float a = i % 5 == 0 ? 0.0f : i % 5 == 1 ? 1.0f : uniform(rng);
    planes[3][i] = a;
    for (int c = 0; c < 3; ++c) planes[c][i] = a * uniform(rng);
  }
  for (const bool half : {false, true})
    for (const bool tiled : {false, true})
      for (const int compression : {0, 1, 3, 4}) {
        write_test_exr(folder / "a.exr", w, h, {"R", "G", "B", "A"}, planes,
                       {.half = half, .tiled = tiled, .compression = compression});
        const Image image = read_image(folder / "a.exr");
        ASSERT_EQ(image.channels, 4);
        ASSERT_EQ(image.width, w);
        ASSERT_EQ(image.height, h);
        const double tolerance = half ? 3e-3 : 2e-6;  // half: 2^-11 of colour and alpha, amplified by the curve
        for (int i = 0; i < w * h; ++i) {
          const double a = planes[3][i];
          ASSERT_NEAR(image.data[i * 4 + 3], a, tolerance);
          for (int c = 0; c < 3; ++c) {
            const double linear = a > 0 ? planes[c][i] / a : 0;
            const double want = linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
            ASSERT_NEAR(image.data[i * 4 + c], want, tolerance) << i << " " << c;
          }
        }
      }
}

TEST(ExrIn, ReadsGreyAndSurvivesWhatIsNotANumber) {
  const TemporaryFolder folder;
  const float inf = std::numeric_limits<float>::infinity();
  write_test_exr(folder / "a.exr", 4, 1, {"Y"}, {{0.5f, std::nanf(""), inf, -1.0f}}, {});
  const Image image = read_image(folder / "a.exr");
  ASSERT_EQ(image.channels, 3);
  EXPECT_NEAR(image.at(0, 0)[2], 0.7353569, 1e-5);
  EXPECT_EQ(image.at(1, 0)[0], 0.0f);
  EXPECT_EQ(image.at(2, 0)[1], 1.0f);
  EXPECT_EQ(image.at(3, 0)[0], 0.0f);
}

TEST(ExrIn, PlacesTheDataWindowInTheDisplayWindow) {
  const TemporaryFolder folder;
  const std::vector<float> ones(6, 1.0f);
  write_test_exr(folder / "a.exr", 3, 2, {"R", "G", "B", "A"}, {ones, ones, ones, ones},
                 {.data_x = -1, .data_y = 2, .display_w = 5, .display_h = 4});
  const Image image = read_image(folder / "a.exr");
  ASSERT_EQ(image.width, 5);
  ASSERT_EQ(image.height, 4);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 5; ++x) EXPECT_EQ(image.at(x, y)[3], x < 2 && y >= 2 ? 1.0f : 0.0f) << x << " " << y;
  EXPECT_EQ(read_image_info(folder / "a.exr").width, 5);
}

TEST(ExrIn, NamesMissingChannels) {
  const TemporaryFolder folder;
  const std::vector<float> ones(4, 1.0f);
  write_test_exr(folder / "a.exr", 2, 2, {"R", "layer.G"}, {ones, ones}, {});
  expect_error(Status::format, folder / "a.exr", "layer.G");
}

TEST(ExrOut, UndoesTheCurveAndReadsBack) {
  const TemporaryFolder folder;
  Image colour(3, 2, 3), alpha(3, 2, 1), depth(3, 2, 1);
  for (int i = 0; i < 6; ++i) {
    alpha.data[i] = static_cast<float>(i) / 5.0f;
    depth.data[i] = alpha.data[i] * 3.0f;
    for (int c = 0; c < 3; ++c) colour.data[3 * i + c] = alpha.data[i] * (0.2f + 0.3f * static_cast<float>(c));
  }
  write_exr(folder / "a.exr", colour, alpha, depth);
  const Image back = read_image(folder / "a.exr");
  for (int i = 1; i < 6; ++i) {
    EXPECT_NEAR(back.data[4 * i + 3], alpha.data[i], 5e-4);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(back.data[4 * i + c], 0.2 + 0.3 * c, 1e-3);
  }
  EXPECT_EQ(back.data[3], 0.0f);
}

TEST(ExrOut, LayersAreWrittenUnchanged) {
  const TemporaryFolder folder;
  const Image colour(2, 2, 3, 0.5f), one(2, 2, 1, 1.0f);
  Image normal(2, 2, 3), median(2, 2, 1);
  for (std::size_t i = 0; i < normal.data.size(); ++i) normal.data[i] = static_cast<float>(i) - 5;
  for (std::size_t i = 0; i < median.data.size(); ++i) median.data[i] = 0.1f * static_cast<float>(i);
  const std::vector<PictureLayer> layers{{"median", median}, {"normal", normal}};
  write_exr(folder / "a.exr", colour, one, one, layers);
  write_exr_raw(folder / "b.exr", colour, one, one, layers);
  for (const char* name : {"a.exr", "b.exr"}) {
    Imf::InputFile file((folder / name).c_str());
    const auto read = [&](const char* channel) {
      std::vector<float> out(4);
      Imf::FrameBuffer buffer;
      buffer.insert(channel, Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(out.data()), 4, 8));
      file.setFrameBuffer(buffer);
      file.readPixels(0, 1);
      return out;
    };
    EXPECT_EQ(read("median.Z"), median.data);
    EXPECT_EQ(read("normal.X"), (std::vector<float>{-5, -2, 1, 4}));
    EXPECT_EQ(read("normal.Z"), (std::vector<float>{-3, 0, 3, 6}));
    EXPECT_EQ(read("Z"), one.data);
    EXPECT_EQ(read_image(folder / name).width, 2);  // layers do not hide the picture
  }
}

TEST(DepthPng, HoldsThousandthsOfAUnit) {
  const TemporaryFolder folder;
  Image depth(5, 1, 1);
  depth.data = {0, 1.2344f, 65.535f, 1000, -1};
  write_depth_png(folder / "a.png", depth);
  const Image back = read_image(folder / "a.png");  // 16 bits
  const std::vector<float> wanted{0, 1234, 65535, 65535, 0};
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(back.at(i, 0)[0] * 65535, wanted[static_cast<std::size_t>(i)], 0.01);
}

TEST(Curve, IsUndoneByItsInverse) {
  EXPECT_NEAR(srgb_encode(0.18f), 0.46135, 1e-5);
  EXPECT_NEAR(srgb_decode(0.5f), 0.21404, 1e-5);
  for (int i = 0; i <= 300; ++i) {
    const float v = static_cast<float>(i) / 200.0f;  // beyond 1, too
    EXPECT_NEAR(srgb_encode(srgb_decode(v)), v, 1e-6);
  }
}

TEST(Masks, AreLumaTimesAlpha) {
  const TemporaryFolder folder;
  write_test_png(folder / "a.png", 2, 1, {255, 255, 255, 51, 255, 0, 0, 255},
                 {.colour_type = PNG_COLOR_TYPE_RGB_ALPHA});
  const Image mask = read_mask(folder / "a.png");
  ASSERT_EQ(mask.channels, 1);
  EXPECT_FLOAT_EQ(mask.data[0], 0.2f);
  EXPECT_FLOAT_EQ(mask.data[1], 0.299f);
}

TEST(BadPictures, AreNamed) {
  const TemporaryFolder folder;
  expect_error(Status::file, folder / "none.png", "No such file");
  expect_error(Status::file, folder.string(), "folder");
  write_bytes(folder / "empty.png", {});
  expect_error(Status::format, folder / "empty.png", "empty file");
  write_bytes(folder / "text.png", {'h', 'e', 'l', 'l', 'o'});
  expect_error(Status::format, folder / "text.png", "PNG, JPEG, EXR, TIFF, WebP or BMP");
}

// Sizes that a file of this length cannot hold, and sizes beyond the limit, are refused by the header before memory is
// allocated.
TEST(BadPictures, AbsurdSizesAreRefused) {
  const TemporaryFolder folder;
  write_test_png(folder / "a.png", 1, 1, {1}, {.colour_type = PNG_COLOR_TYPE_GRAY});
  const std::vector<unsigned char> bytes = read_file(folder / "a.png");
  const auto crc = [](const unsigned char* p, std::size_t n) {
    std::uint32_t c = ~0u;
    for (std::size_t i = 0; i < n; ++i) {
      c ^= p[i];
      for (int k = 0; k < 8; ++k) c = c >> 1 ^ (c & 1 ? 0xedb88320u : 0);
    }
    return ~c;
  };
  const auto with_size = [&](std::uint32_t w, std::uint32_t h) {
    auto out = bytes;
    const auto put = [&](std::size_t at, std::uint32_t v) {
      for (int i = 0; i < 4; ++i) out[at + i] = static_cast<unsigned char>(v >> (24 - 8 * i));
    };
    put(16, w);
    put(20, h);
    put(29, crc(&out[12], 17));
    return out;
  };
  write_bytes(folder / "b.png", with_size(16384, 16384));
  expect_error(Status::format, folder / "b.png", "16384 x 16384");
  write_bytes(folder / "c.png", with_size(0x7fffffff, 0x7fffffff));
  expect_error(Status::format, folder / "c.png", "2147483647 x 2147483647");
  write_bytes(folder / "d.png", with_size(0, 5));
  expect_error(Status::format, folder / "d.png", "");
}

// Small files of every kind, with enough content for several chunks, tables and blocks.
std::vector<std::string> specimens(const TemporaryFolder& folder) {
  const int w = 24, h = 17;
  std::vector<std::vector<float>> planes(4, std::vector<float>(w * h));
  std::mt19937 rng(5);
  for (auto& plane : planes)
    for (float& v : plane) v = static_cast<float>(rng() % 1000) / 1000.0f;
  write_test_png(folder / "rgba.png", w, h, random_samples(w * h * 4, 255, 1),
                 {.colour_type = PNG_COLOR_TYPE_RGB_ALPHA});
  write_test_png(folder / "interlaced.png", w, h, random_samples(w * h, 65535, 2),
                 {.colour_type = PNG_COLOR_TYPE_GRAY, .depth = 16, .interlaced = true});
  write_test_png(folder / "palette.png", w, h, random_samples(w * h, 3, 3),
                 {.colour_type = PNG_COLOR_TYPE_PALETTE,
                  .depth = 4,
                  .palette = std::vector<std::uint8_t>(12, 99),
                  .palette_alpha = {1}});
  write_test_jpeg(folder / "colour.jpg", w, h, 3, smooth_samples(w, h, 3));
  write_test_jpeg(folder / "progressive.jpg", w, h, 3, smooth_samples(w, h, 3), true);
  write_test_exr(folder / "zip.exr", w, h, {"R", "G", "B", "A"}, planes, {.half = true});
  write_test_exr(folder / "piz.exr", w, h, {"R", "G", "B", "A"}, planes, {.half = true, .compression = 4});
  write_test_exr(folder / "tiled.exr", w, h, {"Y"}, {planes[0]}, {.half = true, .tiled = true});
  std::vector<std::string> out;
  for (const char* name : {"rgba.png", "interlaced.png", "palette.png", "colour.jpg", "progressive.jpg", "zip.exr",
                           "piz.exr", "tiled.exr"})
    out.push_back(folder / name);
  return out;
}

TEST(BadPictures, EveryTruncationIsAnErrorAndNothingIsPrinted) {
  const TemporaryFolder folder;
  test::expect_truncations_are_errors(specimens(folder));
}

TEST(BadPictures, FlippedBitsAreAnErrorOrAPictureNeverACrash) {
  const TemporaryFolder folder;
  test::expect_flips_are_survived(specimens(folder), 11, 400, [](const FileBytes&) { return false; });
}

}  // namespace
}  // namespace vsplat
