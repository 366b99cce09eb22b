#include "model/io/picture/webp_animation.h"

#include <webp/demux.h>

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
    WebpAnimation animation(options);
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
  WebpAnimation animation(options);
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
    WebpAnimation animation({});
    for (int i = 0; i < 3; ++i) animation.add(frame(i));
    if (run == 0) first = animation.bytes();
    EXPECT_EQ(animation.bytes(), first);
    EXPECT_EQ(animation.bytes(), first);
  }
}

TEST(WebpAnimation, OfOnePictureIsAPicture) {
  WebpAnimation animation({});
  animation.add(frame(0, 1, 1));
  EXPECT_EQ(decode(animation.bytes()).frames.size(), 1U);
}

TEST(WebpAnimation, RefusesWhatItCannotHold) {
  for (const double fps : {0.0, -1.0, 0.05, 101.0, std::nan("")})
    expect_error(Status::usage, {"pictures a second"}, [&] { WebpAnimation({fps, 90}); });
  for (const int quality : {0, 101, -5})
    expect_error(Status::usage, {std::to_string(quality)}, [&] { WebpAnimation({24, quality}); });
  WebpAnimation animation({});
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

}  // namespace
}  // namespace vsplat
