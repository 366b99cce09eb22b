#include "model/io/picture/animation.h"

#include <cmath>

#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"

namespace vsplat {

AnimationFile::AnimationFile(const AnimationOptions& options) : options_(options) {
  if (!(options.fps >= 0.1 && options.fps <= 100))
    fail(Status::usage, "an animation of {} pictures a second; 0.1 to 100 are possible", options.fps);
  if (options.quality < 1 || options.quality > 100)
    fail(Status::usage, "an animation of quality {}; 1 to 100 are possible", options.quality);
}

int AnimationFile::time_of(int index, int units) const {
  return static_cast<int>(std::lround(static_cast<double>(units) * index / options_.fps));
}

void AnimationFile::add(const Image& picture) {
  if (!bytes_.empty()) fail(Status::usage, "the animation is finished: no picture can be added");
  if (picture.empty() || picture.channels != 3)
    fail(Status::internal, "an animation takes 3 channels, not {} x {} x {}", picture.width, picture.height,
         picture.channels);
  if (count_ == 0) {
    if (picture.width > max_side || picture.height > max_side)
      fail(Status::input, "a picture of {} x {} pixels in an animation, which has at most {} to a side", picture.width,
           picture.height, max_side);
    width_ = picture.width, height_ = picture.height;
  }
  if (picture.width != width_ || picture.height != height_)
    fail(Status::input, "picture {} has {} x {} pixels, the first one {} x {}: an animation needs pictures of one size",
         count_, picture.width, picture.height, width_, height_);
  encode(rounded(picture), count_);
  ++count_;
}

const std::vector<unsigned char>& AnimationFile::bytes() {
  if (count_ == 0) fail(Status::usage, "an animation of no pictures");
  if (bytes_.empty()) bytes_ = finish();
  return bytes_;
}

void AnimationFile::write(const std::string& path) {
  const std::vector<unsigned char>& file = bytes();
  write_file(path, file.data(), file.size());
}

}  // namespace vsplat
