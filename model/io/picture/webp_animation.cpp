#include "model/io/picture/webp_animation.h"

#include <webp/encode.h>
#include <webp/mux.h>

#include <cmath>

#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"

namespace vsplat {

struct WebpAnimation::Encoder {
  WebPAnimEncoder* handle = nullptr;
  WebPConfig config{};

  Encoder() = default;
  Encoder(const Encoder&) = delete;
  Encoder& operator=(const Encoder&) = delete;
  ~Encoder() { WebPAnimEncoderDelete(handle); }

  void check(int good) const {
    if (!good) fail(Status::internal, "WebP encoding failed: {}", WebPAnimEncoderGetError(handle));
  }
};

namespace {

struct Frame {
  WebPPicture picture{};

  Frame() { WebPPictureInit(&picture); }
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;
  ~Frame() { WebPPictureFree(&picture); }
};

// Start time of picture `index` in milliseconds.
int time_of(int index, double fps) { return static_cast<int>(std::lround(1000.0 * index / fps)); }

}  // namespace

WebpAnimation::WebpAnimation(const AnimationOptions& options) : options_(options) {
  if (!(options.fps >= 0.1 && options.fps <= 100))
    fail(Status::usage, "an animation of {} pictures a second; 0.1 to 100 are possible", options.fps);
  if (options.quality < 1 || options.quality > 100)
    fail(Status::usage, "an animation of quality {}; 1 to 100 are possible", options.quality);
}

WebpAnimation::~WebpAnimation() = default;

void WebpAnimation::add(const Image& picture) {
  if (!bytes_.empty()) fail(Status::usage, "the animation is finished: no picture can be added");
  if (picture.empty() || picture.channels != 3)
    fail(Status::internal, "an animation takes 3 channels, not {} x {} x {}", picture.width, picture.height,
         picture.channels);
  if (!encoder_) {
    if (picture.width > max_side || picture.height > max_side)
      fail(Status::input, "a picture of {} x {} pixels in an animation: WebP holds at most {} to a side", picture.width,
           picture.height, max_side);
    auto encoder = std::make_unique<Encoder>();
    WebPAnimEncoderOptions how;
    if (!WebPAnimEncoderOptionsInit(&how) || !WebPConfigInit(&encoder->config))
      fail(Status::internal, "the WebP library is of another version than its headers");
    encoder->config.lossless = options_.quality == 100;
    if (!encoder->config.lossless) encoder->config.quality = static_cast<float>(options_.quality);
    encoder->handle = WebPAnimEncoderNew(picture.width, picture.height, &how);
    if (!encoder->handle) fail(Status::memory, "not enough memory to encode an animation");
    width_ = picture.width, height_ = picture.height;
    encoder_ = std::move(encoder);
  }
  if (picture.width != width_ || picture.height != height_)
    fail(Status::input, "picture {} has {} x {} pixels, the first one {} x {}: an animation needs pictures of one size",
         count_, picture.width, picture.height, width_, height_);
  const std::vector<unsigned char> rgb = rounded(picture);
  Frame frame;
  frame.picture.use_argb = 1;
  frame.picture.width = width_, frame.picture.height = height_;
  if (!WebPPictureImportRGB(&frame.picture, rgb.data(), 3 * width_))
    fail(Status::memory, "not enough memory to encode an animation");
  encoder_->check(
      WebPAnimEncoderAdd(encoder_->handle, &frame.picture, time_of(count_, options_.fps), &encoder_->config));
  ++count_;
}

const std::vector<unsigned char>& WebpAnimation::bytes() {
  if (count_ == 0) fail(Status::usage, "an animation of no pictures");
  if (bytes_.empty()) {
    encoder_->check(WebPAnimEncoderAdd(encoder_->handle, nullptr, time_of(count_, options_.fps), nullptr));
    WebPData data;
    WebPDataInit(&data);
    encoder_->check(WebPAnimEncoderAssemble(encoder_->handle, &data));
    bytes_.assign(data.bytes, data.bytes + data.size);
    WebPDataClear(&data);
    encoder_.reset();
  }
  return bytes_;
}

void WebpAnimation::write(const std::string& path) {
  const std::vector<unsigned char>& file = bytes();
  write_file(path, file.data(), file.size());
}

}  // namespace vsplat
