// Animated pictures in a file that plays in an endless loop: WebP, or GIF for programs that do not read it.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/base/image.h"

namespace vsplat {

struct AnimationOptions {
  double fps = 24;  // pictures per second, 0.1 to 100, 50 in GIF; each time is rounded to whole milliseconds, 10 in GIF
  int quality = 90;  // of WebP, 1 to 100; 100 is lossless, otherwise chroma has half the resolution
};

class AnimationFile {
 public:
  static constexpr int max_side = 16383;  // WebP's limit

  explicit AnimationFile(const AnimationOptions& options);  // Error(usage) if a value is out of range
  virtual ~AnimationFile() = default;
  AnimationFile(const AnimationFile&) = delete;
  AnimationFile& operator=(const AnimationFile&) = delete;

  // Encodes the next picture: three channels, rounded to 8 bits as by write_png(). Error(input) if its size differs
  // from the first one's or exceeds max_side, Error(usage) after bytes().
  void add(const Image& picture);
  int count() const { return count_; }
  // The file. Equal pictures give equal bytes. Error(usage) if there is no picture.
  const std::vector<unsigned char>& bytes();
  // Writes the file completely or not at all.
  void write(const std::string& path);

 protected:
  int width() const { return width_; }
  int height() const { return height_; }
  // Start time of picture `index`, in whole units of which a second has `units`.
  int time_of(int index, int units) const;

  AnimationOptions options_;

 private:
  virtual void encode(const std::vector<unsigned char>& rgb, int index) = 0;
  virtual std::vector<unsigned char> finish() = 0;

  int count_ = 0, width_ = 0, height_ = 0;
  std::vector<unsigned char> bytes_;  // after the first call of bytes()
};

// Error(usage) also if GIF was left out of the build, or its pictures are too fast.
std::unique_ptr<AnimationFile> webp_animation(const AnimationOptions& options);
std::unique_ptr<AnimationFile> gif_animation(const AnimationOptions& options);

}  // namespace vsplat
