// The rows of a picture from top to bottom, each read once, so that the whole picture need not be in memory.
#pragma once
#include <algorithm>
#include <cstddef>
#include <vector>

#include "model/base/image.h"

namespace vsplat {

class PixelRows {
 public:
  PixelRows(int w, int h, int c) : width(w), height(h), channels(c) {}
  virtual ~PixelRows() = default;
  PixelRows(const PixelRows&) = delete;
  PixelRows& operator=(const PixelRows&) = delete;

  // The next row, [width][channels] as in Image. Call it at most `height` times.
  virtual void next(float* row) = 0;
  std::size_t row_size() const { return static_cast<std::size_t>(width) * channels; }

  const int width, height, channels;
};

// Rows of a picture in memory, which must outlive this.
class ImageRows : public PixelRows {
 public:
  explicit ImageRows(const Image& image)
      : PixelRows(image.width, image.height, image.channels), from_(image.data.data()) {}
  void next(float* row) override {
    std::copy_n(from_, row_size(), row);
    from_ += row_size();
  }

 private:
  const float* from_;
};

// Reads all rows into a picture.
inline Image image_of(PixelRows& rows) {
  Image out;
  out.width = rows.width, out.height = rows.height, out.channels = rows.channels;
  out.data.resize(rows.row_size() * rows.height);
  for (int y = 0; y < rows.height; ++y) rows.next(out.data.data() + rows.row_size() * y);
  return out;
}

}  // namespace vsplat
