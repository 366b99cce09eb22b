// TIFF, WebP and BMP, and EXIF orientation in every format that has it.
#include <gtest/gtest.h>
#include <png.h>
#include <tiffio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "model/io/picture/image_file.h"
#include "model/io/picture/image_formats.h"
#include "runtime/files/file.h"
#include "tests/support/damaged_pictures.h"
#include "tests/support/image_writers.h"
#include "tests/support/picture_writers.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

constexpr int w = 21, h = 13;  // no multiple of a strip, a tile or the row padding

template <class Sample>
std::vector<Sample> random_samples(int channels, unsigned largest) {
  std::mt19937 rng(7 * channels);
  std::vector<Sample> out(static_cast<std::size_t>(w) * h * channels);
  for (Sample& v : out) v = static_cast<Sample>(rng() % (largest + 1));
  return out;
}

// Each value divided by `largest`; grey is copied to three channels.
template <class Sample>
void expect_samples(const std::string& path, const std::vector<Sample>& samples, int channels, unsigned largest,
                    double tolerance) {
  SCOPED_TRACE(path);
  const ImageInfo info = read_image_info(path);
  const Image image = read_image(path);
  ASSERT_EQ(image.width, w);
  ASSERT_EQ(image.height, h);
  ASSERT_EQ(image.channels, channels == 4 ? 4 : 3);
  EXPECT_EQ(info.width, w);
  EXPECT_EQ(info.height, h);
  EXPECT_EQ(info.alpha, channels == 4);
  EXPECT_EQ(info.orientation, 1);
  for (int i = 0; i < w * h; ++i)
    for (int c = 0; c < image.channels; ++c)
      ASSERT_NEAR(image.data[i * image.channels + c],
                  static_cast<double>(samples[i * channels + (channels == 1 ? 0 : c)]) / largest, tolerance)
          << i << " " << c;
}

std::string message_of(const std::string& path) {
  return test::refusal([&] { read_image(path); }, Status::format);
}

TEST(TiffIn, ReadsEveryLayout) {
  const TemporaryFolder folder;
  for (const int channels : {1, 3})
    for (const int compression : {COMPRESSION_NONE, COMPRESSION_LZW, COMPRESSION_ADOBE_DEFLATE, COMPRESSION_PACKBITS})
      for (const bool tiled : {false, true})
        for (const bool planes : {false, true})
          for (const bool big_endian : {false, true}) {
            SCOPED_TRACE(testing::Message() << channels << " channels, compression " << compression << ", tiled "
                                            << tiled << ", planes " << planes << ", big-endian " << big_endian);
            const auto samples = random_samples<std::uint16_t>(channels, 255);
            test::write_test_tiff(folder / "a.tif", w, h, channels, samples,
                                  {.compression = compression,
                                   .tiled = tiled,
                                   .planes = planes && channels > 1,
                                   .big_endian = big_endian});
            expect_samples(folder / "a.tif", samples, channels, 255, 1e-7);
          }
  const auto deep = random_samples<std::uint16_t>(3, 65535);
  test::write_test_tiff(folder / "deep.tif", w, h, 3, deep, {.depth = 16});
  expect_samples(folder / "deep.tif", deep, 3, 65535, 1.0 / 255);  // as 8 bits
}

// A single strip with all rows: it fits when unpacked, but not together with all pixels.
TEST(TiffIn, ALongStripIsReadInParts) {
  constexpr int width = 9, height = 37;
  const TemporaryFolder folder;
  TIFF* tiff = TIFFOpen((folder / "long.tif").c_str(), "w");
  for (const auto& [tag, value] : {std::pair{TIFFTAG_IMAGEWIDTH, width},
                                   {TIFFTAG_IMAGELENGTH, height},
                                   {TIFFTAG_SAMPLESPERPIXEL, 3},
                                   {TIFFTAG_BITSPERSAMPLE, 8},
                                   {TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB},
                                   {TIFFTAG_ROWSPERSTRIP, height},
                                   {TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG},
                                   {TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE}})
    TIFFSetField(tiff, static_cast<std::uint32_t>(tag), value);
  std::vector<std::uint8_t> samples(static_cast<std::size_t>(width * height * 3));
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = static_cast<std::uint8_t>(i * 89 % 251);
  for (int y = 0; y < height; ++y)
    TIFFWriteScanline(tiff, samples.data() + static_cast<std::ptrdiff_t>(y * width * 3), static_cast<std::uint32_t>(y));
  TIFFClose(tiff);
  const std::string path = folder / "long.tif", bytes = test::contents_of(path);
  const FileBytes file{path, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()};
  const auto beside = static_cast<double>(samples.size() + bytes.size());
  for (const int at_once : {5, 6, 36, 37, 1000}) {
    const std::unique_ptr<FileRows> rows = open_tiff_within(file, beside + 4.0 * width * at_once);
    std::vector<float> row(width * 3);
    for (int y = 0; y < height; ++y) {
      rows->next(row.data());
      for (int i = 0; i < width * 3; ++i)
        ASSERT_NEAR(row[static_cast<std::size_t>(i)], samples[static_cast<std::size_t>(y * width * 3 + i)] / 255.0,
                    1e-7)
            << at_once << " rows at once: row " << y;
    }
  }
  const std::string refused =
      test::refusal([&] { open_tiff_within(file, static_cast<double>(samples.size())); }, Status::input);
  EXPECT_NE(refused.find(path + ": a strip or tile of the TIFF has"), std::string::npos) << refused;
}

// Few bytes that ask for much memory: thousands of samples a pixel, and a tile far beyond the picture.
TEST(TiffIn, WhatUnpacksToFarMoreThanThePictureIsRefused) {
  using Entries = std::vector<std::array<std::uint32_t, 2>>;
  const auto tiff = [](Entries entries) {
    std::string out("II*\0\10\0\0\0", 8);
    const auto put = [&](std::uint32_t value, int bytes) {
      for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> 8 * i & 255);
    };
    std::sort(entries.begin(), entries.end());
    put(static_cast<std::uint32_t>(entries.size()), 2);
    for (const auto& [tag, value] : entries) put(tag, 2), put(4, 2), put(1, 4), put(value, 4);
    put(0, 4);
    return out;
  };
  const Entries rgb{
      {TIFFTAG_BITSPERSAMPLE, 8}, {TIFFTAG_COMPRESSION, COMPRESSION_PACKBITS}, {TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB}};
  Entries samples = rgb, tile = rgb;
  for (const auto& entry : Entries{{TIFFTAG_IMAGEWIDTH, 1},
                                   {TIFFTAG_IMAGELENGTH, 22787},
                                   {TIFFTAG_STRIPOFFSETS, 8},
                                   {TIFFTAG_STRIPBYTECOUNTS, 3},
                                   {TIFFTAG_SAMPLESPERPIXEL, 20000}})
    samples.push_back(entry);
  for (const auto& entry : Entries{{TIFFTAG_IMAGEWIDTH, 3},
                                   {TIFFTAG_IMAGELENGTH, 3},
                                   {TIFFTAG_TILEWIDTH, 16384},
                                   {TIFFTAG_TILELENGTH, 16384},
                                   {TIFFTAG_TILEOFFSETS, 8},
                                   {TIFFTAG_TILEBYTECOUNTS, 3},
                                   {TIFFTAG_SAMPLESPERPIXEL, 3}})
    tile.push_back(entry);
  const TemporaryFolder folder;
  for (const Entries& entries : {samples, tile}) {
    test::put_file(folder / "a.tif", tiff(entries));
    const std::string refused = message_of(folder / "a.tif");
    EXPECT_NE(refused.find("GiB when unpacked, for "), std::string::npos) << refused;
  }
}

TEST(TiffIn, AlphaIsStraightAfterwards) {
  const TemporaryFolder folder;
  std::vector<std::uint16_t> straight, multiplied;
  for (int i = 0; i < w * h; ++i) {
    const int alpha = i % 4 == 0 ? 255 : i % 4 == 1 ? 0 : 100 + i % 100;
    for (const int colour : {200, 100, i % 256}) {
      straight.push_back(static_cast<std::uint16_t>(alpha == 0 ? 0 : colour));
      multiplied.push_back(static_cast<std::uint16_t>(std::lround(colour * alpha / 255.0)));
    }
    straight.push_back(static_cast<std::uint16_t>(alpha));
    multiplied.push_back(static_cast<std::uint16_t>(alpha));
  }
  test::write_test_tiff(folder / "straight.tif", w, h, 4, straight, {});
  test::write_test_tiff(folder / "multiplied.tif", w, h, 4, multiplied, {.associated = true});
  for (const char* name : {"straight.tif", "multiplied.tif"})
    expect_samples(folder / name, straight, 4, 255, 1.0 / 100);  // of 8 bits, divided by at least 100 of 255
}

TEST(TiffIn, WhatIsNotReadIsNamed) {
  const TemporaryFolder folder;
  TIFF* tiff = TIFFOpen((folder / "float.tif").c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, 4);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, 1);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 32);
  TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  float row[4] = {};
  TIFFWriteScanline(tiff, row, 0);
  TIFFClose(tiff);
  const std::string text = message_of(folder / "float.tif");
  EXPECT_NE(text.find("float.tif"), std::string::npos) << text;
  EXPECT_NE(text.find("TIFF"), std::string::npos) << text;
  EXPECT_NE(text.find("32"), std::string::npos) << text;
}

TEST(WebpIn, ReadsStillPictures) {
  const TemporaryFolder folder;
  for (const int channels : {3, 4}) {
    std::vector<std::uint8_t> samples = random_samples<std::uint8_t>(channels, 255);
    for (std::size_t i = 3; channels == 4 && i < samples.size(); i += 4)
      samples[i] = static_cast<std::uint8_t>(1 + samples[i] % 255);  // the encoder may discard invisible colours
    test::write_test_webp(folder / "a.webp", w, h, channels, samples);
    expect_samples(folder / "a.webp", samples, channels, 255, 1e-7);
  }
  std::vector<std::uint8_t> smooth;
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      for (int c = 0; c < 3; ++c) smooth.push_back(static_cast<std::uint8_t>(100 + 3 * x + 2 * y));
  test::write_test_webp(folder / "b.webp", w, h, 3, smooth, 95);
  expect_samples(folder / "b.webp", smooth, 3, 255, 0.03);
}

TEST(WebpIn, AnimationsAreRefusedByName) {
  const TemporaryFolder folder;
  test::write_animated_webp(folder / "a.webp", w, h, 3);
  const std::string text = message_of(folder / "a.webp");
  EXPECT_NE(text.find("animated WebP"), std::string::npos) << text;
}

TEST(BmpIn, ReadsGreyColourAndAlpha) {
  const TemporaryFolder folder;
  for (const int channels : {1, 3, 4})
    for (const bool top_down : {false, true}) {
      const auto samples = random_samples<std::uint8_t>(channels, 255);
      test::write_test_bmp(folder / "a.bmp", w, h, channels, samples, top_down);
      expect_samples(folder / "a.bmp", samples, channels, 255, 1e-7);
    }
}

// The position of the first row and column by EXIF: 1 2 3 / 4 5 6 as stored is displayed as ...
TEST(Orientation, TurnsAsExifSays) {
  const TemporaryFolder folder;
  const std::vector<float> shown[] = {{1, 2, 3, 4, 5, 6}, {3, 2, 1, 6, 5, 4}, {6, 5, 4, 3, 2, 1}, {4, 5, 6, 1, 2, 3},
                                      {1, 4, 2, 5, 3, 6}, {4, 1, 5, 2, 6, 3}, {6, 3, 5, 2, 4, 1}, {3, 6, 2, 5, 1, 4}};
  // In 8 bits, in 16 bits, and as float.
  write_test_png(folder / "a.png", 3, 2, {1, 2, 3, 4, 5, 6}, {.colour_type = PNG_COLOR_TYPE_GRAY});
  write_test_png(folder / "b.png", 3, 2, {1, 2, 3, 4, 5, 6}, {.colour_type = PNG_COLOR_TYPE_GRAY, .depth = 16});
  Image values(3, 2, 3);
  for (std::size_t k = 0; k < values.data.size(); ++k) {
    const std::size_t pixel = k / 3;
    values.data[k] = static_cast<float>(pixel + 1) / 7;
  }
  write_exr_raw(folder / "c.exr", values, Image(3, 2, 1, 1.0f), Image(3, 2, 1));
  for (const auto& [name, most] : {std::pair("a.png", 255.0f), std::pair("b.png", 65535.0f), std::pair("c.exr", 0.0f)})
    for (int i = 1; i <= 8; ++i) {
      const ImageFile file(folder / name);
      const Image stored = file.decode(), out = file.decode(i);
      EXPECT_EQ(out.width, i >= 5 ? 2 : 3) << i;
      for (std::size_t k = 0; k < 6; ++k) {
        const float v = shown[i - 1][k];
        EXPECT_EQ(out.data[k * out.channels], stored.data[static_cast<std::size_t>(v - 1) * out.channels]) << name << i;
        if (most > 0) {
          EXPECT_EQ(out.data[k * out.channels], v / most) << name << i;
        }
      }
    }
}

TEST(Orientation, IsReadFromEveryFormatThatStatesIt) {
  const TemporaryFolder folder;
  const auto bytes = random_samples<std::uint8_t>(3, 255);
  const std::vector<std::uint16_t> samples(bytes.begin(), bytes.end());
  Image colour(w, h, 3);
  for (std::size_t i = 0; i < bytes.size(); ++i) colour.data[i] = bytes[i] / 255.0f;
  for (int orientation = 1; orientation <= 8; ++orientation)
    for (const bool big_endian : {false, true}) {
      const std::string exif = test::exif_data(orientation, big_endian);
      test::write_test_tiff(folder / "a.tif", w, h, 3, samples, {.big_endian = big_endian, .orientation = orientation});
      test::write_test_webp(folder / "a.webp", w, h, 3, bytes, 0, exif);
      write_jpeg(folder / "a.jpg", colour, 90);
      test::add_exif_to_jpeg(folder / "a.jpg", exif);
      for (const char* name : {"a.tif", "a.webp", "a.jpg"}) {
        const ImageInfo info = read_image_info(folder / name);
        EXPECT_EQ(info.orientation, orientation) << name;
        EXPECT_EQ(info.width, w) << name;
        const Image image = read_image(folder / name);  // as stored
        ASSERT_EQ(image.width, w) << name;
        if (std::string(name) == "a.jpg") continue;
        for (std::size_t i = 0; i < bytes.size(); ++i) ASSERT_NEAR(image.data[i], bytes[i] / 255.0, 1e-7) << name;
      }
    }
  // An invalid value, and data cut off anywhere, count as none: 1.
  for (const int wrong : {0, 9, 77}) {
    write_jpeg(folder / "a.jpg", colour, 90);
    test::add_exif_to_jpeg(folder / "a.jpg", test::exif_data(wrong));
    EXPECT_EQ(read_image_info(folder / "a.jpg").orientation, 1);
  }
  const std::string exif = test::exif_data(6);
  for (std::size_t size = 0; size < 20; ++size) {
    write_jpeg(folder / "a.jpg", colour, 90);
    test::add_exif_to_jpeg(folder / "a.jpg", exif.substr(0, size));
    EXPECT_EQ(read_image_info(folder / "a.jpg").orientation, 1) << size;
  }
}

TEST(Lens, IsWhatExifNames) {
  const TemporaryFolder folder;
  const auto lens = [&](const std::string& exif) {
    write_jpeg(folder / "a.jpg", Image(w, h, 3), 90);
    if (!exif.empty()) test::add_exif_to_jpeg(folder / "a.jpg", exif);
    test::write_test_webp(folder / "a.webp", w, h, 3, random_samples<std::uint8_t>(3, 255), 0, exif);
    EXPECT_EQ(read_image_info(folder / "a.webp").lens, read_image_info(folder / "a.jpg").lens);
    return read_image_info(folder / "a.jpg").lens;
  };
  EXPECT_EQ(lens(""), "");
  EXPECT_EQ(lens(test::exif_data(1)), "");
  EXPECT_EQ(lens(test::lens_exif_data("Box 1 ", 35)), "Box 1, 35.0 mm");
  EXPECT_EQ(lens(test::lens_exif_data("Box 1", 50)), "Box 1, 50.0 mm");
}

std::vector<std::string> picture_specimens(const TemporaryFolder& folder) {
  const auto rgb = random_samples<std::uint8_t>(3, 255), rgba = random_samples<std::uint8_t>(4, 255);
  const auto deep = random_samples<std::uint16_t>(3, 65535);
  const std::vector<std::uint16_t> wide(rgba.begin(), rgba.end());
  test::write_test_tiff(folder / "deep.tif", w, h, 3, deep, {.depth = 16, .compression = COMPRESSION_LZW});
  test::write_test_tiff(folder / "alpha.tif", w, h, 4, wide, {.compression = COMPRESSION_ADOBE_DEFLATE, .tiled = true});
  test::write_test_webp(folder / "rgba.webp", w, h, 4, rgba);
  test::write_test_webp(folder / "lossy.webp", w, h, 4, rgba, 80);
  test::write_test_webp(folder / "exif.webp", w, h, 3, rgb, 0, test::exif_data(6));
  test::write_test_bmp(folder / "rgb.bmp", w, h, 3, rgb);
  test::write_test_bmp(folder / "rgba.bmp", w, h, 4, rgba, true);
  test::write_test_bmp(folder / "grey.bmp", w, h, 1, rgb);
  std::vector<std::string> out;
  for (const std::string& name : folder.entries()) out.push_back(folder / name);
  return out;
}

TEST(BadPictureFormats, EveryTruncationIsAnErrorAndNothingIsPrinted) {
  const TemporaryFolder folder;
  test::expect_truncations_are_errors(picture_specimens(folder));
}

TEST(BadPictureFormats, FlippedBitsAreAnErrorOrAPictureNeverACrash) {
  const TemporaryFolder folder;
  const auto large = [](const FileBytes& file) {
    if (!is_webp(file) && !is_bmp(file) && !is_tiff(file)) return false;
    const ImageInfo info = is_webp(file) ? webp_info(file) : is_bmp(file) ? bmp_info(file) : tiff_info(file);
    return static_cast<long>(info.width) * info.height > 1 << 22;
  };
  test::expect_flips_are_survived(picture_specimens(folder), 13, 120, large);
}

}  // namespace
}  // namespace vsplat
