// Pictures one after the other in a file that browsers play: animated WebP, out only.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/base/image.h"

namespace vsplat {

struct AnimationOptions {
  double fps = 24;   // pictures per second, 0.1 to 100: times are whole milliseconds, rounded one by one
  int quality = 90;  // 1 to 100; 100: without loss, else colours are kept at half the resolution
};

class WebpAnimation {
 public:
  static constexpr int max_side = 16383;  // the format's

  explicit WebpAnimation(const AnimationOptions& options);  // Error(usage) where a value is out of its range
  ~WebpAnimation();
  WebpAnimation(const WebpAnimation&) = delete;
  WebpAnimation& operator=(const WebpAnimation&) = delete;

  // The next picture, three channels, rounded to 8 bits as write_png() does. It is encoded here and now. Error(input)
  // where its size is not the first one's or beyond max_side, Error(usage) after bytes().
  void add(const Image& picture);
  int count() const { return count_; }
  // The file: plays in a loop without end. The same pictures give the same bytes. Error(usage) where there is none.
  const std::vector<unsigned char>& bytes();
  // The file, whole or not at all.
  void write(const std::string& path);

 private:
  struct Encoder;

  AnimationOptions options_;
  int count_ = 0, width_ = 0, height_ = 0;
  std::unique_ptr<Encoder> encoder_;
  std::vector<unsigned char> bytes_;  // once they have been asked for
};

}  // namespace vsplat
