// Drawn pictures in the pixel formats of callers: 8, 16 or 32 bits, in rows.
#pragma once
#include <string>

#include "model/api/handle.h"
#include "model/api/result_memory.h"

namespace vsplat::api {

// Returns the bytes from the first to the last of `rows` rows of `row` bytes each, `row_bytes` apart. Error(usage) if
// they exceed `capacity` bytes (0: unknown) or any address space. `what` names the struct in errors.
std::size_t bytes_of_rows(std::size_t rows, std::size_t row, std::size_t row_bytes, std::size_t capacity,
                          const std::string& what);

// A picture's `data` and format, checked against a size; `what` names the picture in errors.
class CallersPixels {
 public:
  CallersPixels(const vsplat_picture& picture, int width, int height, const std::string& what);
  // Adds the memory that is written.
  void add_to(Outputs& outputs, const std::string& name) const;
  bool wanted() const { return data_ != nullptr; }
  bool wants_alpha() const { return wanted() && channels_ == 4; }
  // Writes colour [height][width][3] as drawn over the background, and alpha [height][width], NULL if not wanted.
  void write(const float* colour, const float* alpha, const float (&background)[3]) const;

 private:
  unsigned char* data_;
  int type_, channels_, width_, height_;
  bool premultiplied_;
  std::size_t row_ = 0, row_bytes_ = 0;
};

}  // namespace vsplat::api
