#include <webp/encode.h>
#include <webp/mux.h>

#include "model/io/picture/animation.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

struct Frame {
  WebPPicture picture{};

  Frame() { WebPPictureInit(&picture); }
  Frame(const Frame&) = delete;
  Frame& operator=(const Frame&) = delete;
  ~Frame() { WebPPictureFree(&picture); }
};

class WebpAnimation : public AnimationFile {
 public:
  explicit WebpAnimation(const AnimationOptions& options) : AnimationFile(options) {
    if (!WebPConfigInit(&config_)) fail(Status::internal, "the WebP library is of another version than its headers");
    config_.lossless = options_.quality == 100;
    if (!config_.lossless) config_.quality = static_cast<float>(options_.quality);
  }
  ~WebpAnimation() override { WebPAnimEncoderDelete(encoder_); }
  WebpAnimation(const WebpAnimation&) = delete;
  WebpAnimation& operator=(const WebpAnimation&) = delete;

 private:
  void check(int good) const {
    if (!good) fail(Status::internal, "WebP encoding failed: {}", WebPAnimEncoderGetError(encoder_));
  }

  void encode(const std::vector<unsigned char>& rgb, int index) override {
    if (!encoder_) {
      WebPAnimEncoderOptions how;
      if (!WebPAnimEncoderOptionsInit(&how))
        fail(Status::internal, "the WebP library is of another version than its headers");
      encoder_ = WebPAnimEncoderNew(width(), height(), &how);
      if (!encoder_) fail(Status::memory, "not enough memory to encode an animation");
    }
    Frame frame;
    frame.picture.use_argb = 1;
    frame.picture.width = width(), frame.picture.height = height();
    if (!WebPPictureImportRGB(&frame.picture, rgb.data(), 3 * width()))
      fail(Status::memory, "not enough memory to encode an animation");
    check(WebPAnimEncoderAdd(encoder_, &frame.picture, time_of(index, 1000), &config_));
  }

  std::vector<unsigned char> finish() override {
    check(WebPAnimEncoderAdd(encoder_, nullptr, time_of(count(), 1000), nullptr));
    WebPData data;
    WebPDataInit(&data);
    check(WebPAnimEncoderAssemble(encoder_, &data));
    std::vector<unsigned char> out(data.bytes, data.bytes + data.size);
    WebPDataClear(&data);
    WebPAnimEncoderDelete(encoder_);
    encoder_ = nullptr;
    return out;
  }

  WebPAnimEncoder* encoder_ = nullptr;
  WebPConfig config_{};
};

}  // namespace

std::unique_ptr<AnimationFile> webp_animation(const AnimationOptions& options) {
  return std::make_unique<WebpAnimation>(options);
}

}  // namespace vsplat
