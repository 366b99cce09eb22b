#include "model/io/picture/oriented_rows.h"

#include <cmath>
#include <cstdint>
#include <cstring>

namespace vsplat {
namespace {

template <class T>
void put(unsigned char* to, T value) {
  std::memcpy(to, &value, sizeof value);
}

template <class T>
T got(const unsigned char* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return value;
}

}  // namespace

OrientedRows::OrientedRows(const FileBytes& file, FileRows& stored, int orientation)
    : PixelRows(orientation >= 5 ? stored.height : stored.width, orientation >= 5 ? stored.width : stored.height,
                stored.channels),
      orientation_(orientation),
      bytes_(static_cast<std::size_t>(stored.bits) / 8),
      step_(stored.row_size() * bytes_),
      held_(
          memory_to_decode(file, {stored.width, stored.height, false, 1, static_cast<double>(step_) * stored.height})) {
  values_.resize(step_ * static_cast<std::size_t>(stored.height));
  std::vector<float> row(stored.row_size());
  unsigned char* to = values_.data();
  for (int y = 0; y < stored.height; ++y) {
    stored.next(row.data());
    for (const float v : row) {
      if (bytes_ == 1)
        put(to, static_cast<std::uint8_t>(std::lround(v * 255.0f)));
      else if (bytes_ == 2)
        put(to, static_cast<std::uint16_t>(std::lround(v * 65535.0f)));
      else
        put(to, v);
      to += bytes_;
    }
  }
}

// Values of FileRows::bits bits are reproduced exactly.
float OrientedRows::value(const unsigned char* from) const {
  if (bytes_ == 1) return static_cast<float>(*from) / 255.0f;
  if (bytes_ == 2) return static_cast<float>(got<std::uint16_t>(from)) / 65535.0f;
  return got<float>(from);
}

void OrientedRows::next(float* row) {
  // The position in the displayed picture of the stored first row and column, by EXIF orientation.
  const int o = orientation_, y = at_++;
  const bool right = o == 2 || o == 3 || o == 6 || o == 7, low = o == 3 || o == 4 || o == 7 || o == 8;
  const std::size_t pixel = bytes_ * static_cast<std::size_t>(channels);
  const std::size_t along_x = o >= 5 ? step_ : pixel, along_y = o >= 5 ? pixel : step_;
  for (int x = 0; x < width; ++x) {
    const int u = right ? width - 1 - x : x, v = low ? height - 1 - y : y;
    const unsigned char* from = values_.data() + u * along_x + v * along_y;
    for (int c = 0; c < channels; ++c, from += bytes_) *row++ = value(from);
  }
}

}  // namespace vsplat
