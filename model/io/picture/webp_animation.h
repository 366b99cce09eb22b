// Writes animated WebP, which browsers play.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/base/image.h"

namespace vsplat {

struct AnimationOptions {
  double fps = 24;   // pictures per second, 0.1 to 100; each time is rounded to whole milliseconds
  int quality = 90;  // 1 to 100; 100 is lossless, otherwise chroma has half the resolution
};

class WebpAnimation {
 public:
  static constexpr int max_side = 16383;  // the format's limit

  explicit WebpAnimation(const AnimationOptions& options);  // Error(usage) if a value is out of range
  ~WebpAnimation();
  WebpAnimation(const WebpAnimation&) = delete;
  WebpAnimation& operator=(const WebpAnimation&) = delete;

  // Encodes the next picture: three channels, rounded to 8 bits as by write_png(). Error(input) if its size differs
  // from the first one's or exceeds max_side, Error(usage) after bytes().
  void add(const Image& picture);
  int count() const { return count_; }
  // The file, which plays in an endless loop. Equal pictures give equal bytes. Error(usage) if there is no picture.
  const std::vector<unsigned char>& bytes();
  // Writes the file completely or not at all.
  void write(const std::string& path);

 private:
  struct Encoder;

  AnimationOptions options_;
  int count_ = 0, width_ = 0, height_ = 0;
  std::unique_ptr<Encoder> encoder_;
  std::vector<unsigned char> bytes_;  // after the first call of bytes()
};

}  // namespace vsplat
