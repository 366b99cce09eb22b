// Drawn pictures as the caller's programs keep theirs: of 8, 16 or 32 bits, in rows.
#pragma once
#include <string>

#include "model/api/handle.h"
#include "model/api/outputs.h"

namespace vsplat::api {

// Rows of `row` bytes each, `row_bytes` apart, in memory of `capacity` bytes (0: not told): refused where they do not
// fit, or would in no memory. `what` names the struct that has them. Returns the bytes from the first to the last.
std::size_t bytes_of_rows(std::size_t rows, std::size_t row, std::size_t row_bytes, std::size_t capacity,
                          const std::string& what);

// `data` of a picture and how it is meant, checked against a size; `what` names the picture in errors.
class CallersPixels {
 public:
  CallersPixels(const vsplat_picture& picture, int width, int height, const std::string& what);
  // Where they are written.
  void add_to(Outputs& outputs, const std::string& name) const;
  bool wanted() const { return data_ != nullptr; }
  bool wants_alpha() const { return wanted() && channels_ == 4; }
  // colour [height][width][3] as it was drawn over the background, alpha [height][width] or NULL where not wanted.
  void write(const float* colour, const float* alpha, const float (&background)[3]) const;

 private:
  unsigned char* data_;
  int type_, channels_, width_, height_;
  bool premultiplied_;
  std::size_t row_ = 0, row_bytes_ = 0;
};

}  // namespace vsplat::api
