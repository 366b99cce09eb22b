// Drawn pictures as the caller's programs keep theirs: of 8, 16 or 32 bits, in rows.
#pragma once
#include <string>

#include "model/api/handle.h"

namespace vsplat::api {

// `data` of a picture and how it is meant, checked against a width; `what` names the picture in errors.
class CallersPixels {
 public:
  CallersPixels(const vsplat_picture& picture, int width, const std::string& what);
  bool wanted() const { return data_ != nullptr; }
  bool wants_alpha() const { return wanted() && channels_ == 4; }
  // colour [height][width][3] as it was drawn over the background, alpha [height][width] or NULL where not wanted.
  void write(const float* colour, const float* alpha, int height, const float (&background)[3]) const;

 private:
  unsigned char* data_;
  int type_, channels_, width_;
  bool premultiplied_;
  std::size_t row_bytes_ = 0;
};

}  // namespace vsplat::api
