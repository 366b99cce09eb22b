#include "model/io/picture/animation.h"

#include <webp/demux.h>
#ifdef VSPLAT_GIF
#include <gif_lib.h>
#endif

#include <cmath>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

// A smooth picture whose colours depend on `index`.
Image frame(int index, int width = 33, int height = 20) {
  Image out(width, height, 3);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c)
        out.at(x, y)[c] =
            0.5f + 0.4f * std::sin(0.1f * static_cast<float>(x + y * (c + 1)) + static_cast<float>(index));
  return out;
}

struct Decoded {
  WebPAnimInfo info{};
  std::vector<std::vector<std::uint8_t>> frames;  // RGBA
  std::vector<int> ends;                          // milliseconds
};

#ifdef VSPLAT_GIF
// Whether it loops for ever is looked up in the bytes; the end times are the sums of the delays.
Decoded decode_gif(const std::vector<unsigned char>& file) {
  Decoded out;
  auto rest = std::make_pair(file.data(), file.size());
  const auto read = [](GifFileType* gif, GifByteType* to, int count) {
    auto& from = *static_cast<std::pair<const unsigned char*, std::size_t>*>(gif->UserData);
    const std::size_t n = std::min(from.second, static_cast<std::size_t>(count));
    std::copy_n(from.first, n, to);
    from.first += n, from.second -= n;
    return static_cast<int>(n);
  };
  int error = 0;
  GifFileType* gif = DGifOpen(&rest, read, &error);
  EXPECT_NE(gif, nullptr);
  if (!gif) return out;
  EXPECT_EQ(DGifSlurp(gif), GIF_OK);
  out.info.canvas_width = gif->SWidth, out.info.canvas_height = gif->SHeight;
  const std::string loop("NETSCAPE2.0\3\1\0\0", 15);
  out.info.loop_count = std::search(file.begin(), file.end(), loop.begin(), loop.end()) == file.end();
  for (int i = 0; i < gif->ImageCount; ++i) {
    const SavedImage& image = gif->SavedImages[i];
    std::vector<std::uint8_t>& rgba = out.frames.emplace_back();
    for (int k = 0; k < gif->SWidth * gif->SHeight; ++k) {
      const GifColorType colour = image.ImageDesc.ColorMap->Colors[image.RasterBits[k]];
      rgba.insert(rgba.end(), {colour.Red, colour.Green, colour.Blue, 255});
    }
    GraphicsControlBlock control;
    EXPECT_EQ(DGifSavedExtensionToGCB(gif, i, &control), GIF_OK);
    out.ends.push_back((out.ends.empty() ? 0 : out.ends.back()) + 10 * control.DelayTime);
  }
  DGifCloseFile(gif, nullptr);
  return out;
}
#endif

Decoded decode(const std::vector<unsigned char>& file) {
  Decoded out;
  const WebPData data{file.data(), file.size()};
  WebPAnimDecoder* decoder = WebPAnimDecoderNew(&data, nullptr);
  EXPECT_NE(decoder, nullptr);
  if (!decoder) return out;
  WebPAnimDecoderGetInfo(decoder, &out.info);
  std::uint8_t* pixels = nullptr;
  int end = 0;
  while (WebPAnimDecoderHasMoreFrames(decoder) && WebPAnimDecoderGetNext(decoder, &pixels, &end)) {
    out.frames.emplace_back(pixels,
                            pixels + static_cast<std::size_t>(out.info.canvas_width) * out.info.canvas_height * 4);
    out.ends.push_back(end);
  }
  WebPAnimDecoderDelete(decoder);
  return out;
}

struct Errors {
  double worst = 0, mean = 0;
};
Errors errors_of(const std::vector<std::uint8_t>& rgba, const Image& wanted) {
  Errors out;
  for (std::size_t i = 0; i < wanted.data.size(); ++i) {
    const double e = std::abs(rgba[i / 3 * 4 + i % 3] / 255.0 - std::clamp(wanted.data[i], 0.0f, 1.0f));
    out.worst = std::max(out.worst, e);
    out.mean += e / static_cast<double>(wanted.data.size());
  }
  return out;
}

TEST(WebpAnimation, HoldsThePicturesInOrder) {
  for (const int quality : {100, 95}) {
    AnimationOptions options;
    options.fps = 30;
    options.quality = quality;
    const auto made = webp_animation(options);
    AnimationFile& animation = *made;
    for (int i = 0; i < 7; ++i) animation.add(frame(i));
    const Decoded got = decode(animation.bytes());
    EXPECT_EQ(got.info.canvas_width, 33U);
    EXPECT_EQ(got.info.canvas_height, 20U);
    EXPECT_EQ(got.info.loop_count, 0U);  // endless
    ASSERT_EQ(got.frames.size(), 7U);
    for (int i = 0; i < 7; ++i) {
      const Errors own = errors_of(got.frames[i], frame(i)), others = errors_of(got.frames[i], frame((i + 1) % 7));
      EXPECT_LT(own.mean, 0.2 * others.mean);
      EXPECT_LE(own.worst, quality == 100 ? 0.5 / 255 + 1e-6 : 1.0);
      EXPECT_EQ(got.ends[i], std::lround((i + 1) * 1000.0 / 30));  // no drift: 33, 67, 100, ...
    }
  }
}

TEST(WebpAnimation, RoundsLikeOtherPictures) {
  AnimationOptions options;
  options.quality = 100;
  const auto made = webp_animation(options);
  AnimationFile& animation = *made;
  Image picture(2, 1, 3);
  picture.data = {-1.0f, 2.0f, std::nanf(""), 0.5f / 255, 1.49f / 255, 1.0f};
  animation.add(picture);
  picture.data[0] = 1;
  animation.add(picture);
  const Decoded got = decode(animation.bytes());
  ASSERT_EQ(got.frames.size(), 2U);
  EXPECT_EQ(got.frames[0], (std::vector<std::uint8_t>{0, 255, 0, 255, 1, 1, 255, 255}));
}

TEST(WebpAnimation, GivesTheSameBytesAgain) {
  std::vector<unsigned char> first;
  for (int run = 0; run < 3; ++run) {
    const auto made = webp_animation({});
    AnimationFile& animation = *made;
    for (int i = 0; i < 3; ++i) animation.add(frame(i));
    if (run == 0) first = animation.bytes();
    EXPECT_EQ(animation.bytes(), first);
    EXPECT_EQ(animation.bytes(), first);
  }
}

TEST(WebpAnimation, OfOnePictureIsAPicture) {
  const auto made = webp_animation({});
  AnimationFile& animation = *made;
  animation.add(frame(0, 1, 1));
  EXPECT_EQ(decode(animation.bytes()).frames.size(), 1U);
}

TEST(WebpAnimation, RefusesWhatItCannotHold) {
  for (const double fps : {0.0, -1.0, 0.05, 101.0, std::nan("")})
    expect_error(Status::usage, {"pictures a second"}, [&] { webp_animation({fps, 90}); });
  for (const int quality : {0, 101, -5})
    expect_error(Status::usage, {std::to_string(quality)}, [&] { webp_animation({24, quality}); });
  const auto made = webp_animation({});
  AnimationFile& animation = *made;
  expect_error(Status::usage, {"no pictures"}, [&] { animation.bytes(); });
  expect_error(Status::input, {"16384 x 1", "16383"}, [&] { animation.add(Image(16384, 1, 3)); });
  animation.add(frame(0));
  expect_error(Status::input, {"picture 1", "34 x 20", "33 x 20"}, [&] { animation.add(frame(1, 34, 20)); });
  animation.bytes();
  expect_error(Status::usage, {"finished"}, [&] { animation.add(frame(1)); });
  const test::TemporaryFolder folder;
  expect_error(Status::file, {"nowhere"}, [&] { animation.write(folder / "nowhere/x.webp"); });
  animation.write(folder / "x.webp");
  const std::string file = test::contents_of(folder / "x.webp");
  EXPECT_EQ(std::vector<unsigned char>(file.begin(), file.end()), animation.bytes());
}

#ifdef VSPLAT_GIF
TEST(GifAnimation, HoldsThePicturesInOrder) {
  const auto animation = gif_animation({.fps = 30});
  for (int i = 0; i < 7; ++i) animation->add(frame(i, 160, 120));
  const Decoded got = decode_gif(animation->bytes());
  EXPECT_EQ(got.info.canvas_width, 160U);
  EXPECT_EQ(got.info.canvas_height, 120U);
  EXPECT_EQ(got.info.loop_count, 0U);  // endless
  ASSERT_EQ(got.frames.size(), 7U);
  for (int i = 0; i < 7; ++i) {
    const Errors own = errors_of(got.frames[i], frame(i, 160, 120));
    const Errors others = errors_of(got.frames[i], frame((i + 1) % 7, 160, 120));
    EXPECT_LT(own.mean, 0.5 * others.mean);                          // the last frame is much like the first: 0.31
    EXPECT_LT(own.mean, 0.03);                                       // 256 colours stand for thousands
    EXPECT_EQ(got.ends[i], 10 * std::lround((i + 1) * 100.0 / 30));  // no drift: 30, 70, 100, ...
  }
  const std::vector<unsigned char> first = animation->bytes();
  const auto again = gif_animation({.fps = 30});
  for (int i = 0; i < 7; ++i) again->add(frame(i, 160, 120));
  EXPECT_EQ(again->bytes(), first);
}

// With dithering the errors of neighbours cancel: the error of a block's mean is 0.14 of a pixel's here, 0.45 without.
TEST(GifAnimation, DithersRampsOverAPlainBackground) {
  Image picture(256, 64, 3);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 256; ++x)
      for (int c = 0; c < 3; ++c) {
        const float ramps[] = {static_cast<float>(x) / 255, static_cast<float>(y) / 63, 0.5f};
        picture.at(x, y)[c] = y < 16 ? 250.0f / 255 : ramps[c];
      }
  const auto animation = gif_animation({});
  animation->add(picture);
  const std::vector<std::uint8_t> got = decode_gif(animation->bytes()).frames.at(0);
  for (std::size_t i = 0; i < 4 * 256 * 16; ++i) ASSERT_EQ(got[i], i % 4 == 3 ? 255 : 250);
  double of_blocks = 0, of_pixels = 0;  // sums of errors, both over as many values as pixels have
  for (int y = 16; y < 64; y += 8)
    for (int x = 0; x < 256; x += 8)
      for (int c = 0; c < 3; ++c) {
        double off = 0;
        for (int k = 0; k < 64; ++k) {
          const int column = x + k % 8, line = y + k / 8;
          const double e =
              got[4 * (256 * static_cast<std::size_t>(line) + static_cast<std::size_t>(column)) + c] / 255.0 -
              picture.at(column, line)[c];
          off += e;
          of_pixels += std::abs(e);
        }
        of_blocks += std::abs(off);
      }
  EXPECT_LT(of_blocks, 0.25 * of_pixels);
}

TEST(GifAnimation, HoldsFewColoursExactly) {
  Image picture(3, 2, 3);
  picture.data = {0, 0, 0, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0.2f, 0.4f, 0.6f};
  const auto animation = gif_animation({});
  animation->add(picture);
  animation->add(Image(3, 2, 3));  // black
  const Decoded got = decode_gif(animation->bytes());
  EXPECT_LT(errors_of(got.frames.at(0), picture).worst, 1e-6);
  EXPECT_LT(errors_of(got.frames.at(1), Image(3, 2, 3)).worst, 1e-6);
}

TEST(GifAnimation, RefusesWhatItCannotHold) {
  expect_error(Status::usage, {"60", "50"}, [] { gif_animation({.fps = 60}); });
  const auto animation = gif_animation({});
  expect_error(Status::usage, {"no pictures"}, [&] { animation->bytes(); });
  expect_error(Status::input, {"16384 x 1", "16383"}, [&] { animation->add(Image(16384, 1, 3)); });
}
#else
TEST(GifAnimation, IsRefusedWhereTheLibraryIsMissing) {
  expect_error(Status::usage, {"GIF", "libgif-dev"}, [] { gif_animation({}); });
}
#endif

}  // namespace
}  // namespace vsplat
