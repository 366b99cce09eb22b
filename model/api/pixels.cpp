#include "model/api/pixels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "runtime/fail.h"
#include "runtime/half.h"

namespace vsplat::api {
namespace {

std::size_t bytes_of(int type) { return type == VSPLAT_PIXELS_U8 ? 1 : type == VSPLAT_PIXELS_F16 ? 2 : 4; }

// Rounds like write_png().
unsigned char rounded_to_8_bits(float value) {
  const float v = value > 0 ? std::fmin(value, 1.0f) : 0.0f;
  return static_cast<unsigned char>(std::lround(255.0f * v));
}

}  // namespace

std::size_t bytes_of_rows(std::size_t rows, std::size_t row, std::size_t row_bytes, std::size_t capacity,
                          const std::string& what) {
  if (rows == 0) return 0;
  constexpr std::size_t most = PTRDIFF_MAX;
  if (row > most || (rows > 1 && row_bytes > (most - row) / (rows - 1)))
    fail(Status::usage, "{}.row_bytes is {}: no memory holds {} such rows", what, row_bytes, rows);
  const std::size_t bytes = (rows - 1) * row_bytes + row;
  if (capacity > 0 && capacity < bytes)
    fail(Status::usage, "{}.data_bytes is {}: {} rows of {} bytes, {} bytes from one to the next, take {}", what,
         capacity, rows, row, row_bytes, bytes);
  return bytes;
}

CallersPixels::CallersPixels(const vsplat_picture& picture, int width, int height, const std::string& what)
    : data_(static_cast<unsigned char*>(picture.data)),
      type_(value_of(picture.type)),
      channels_(picture.channels),
      width_(width),
      height_(height),
      premultiplied_(picture.premultiplied != 0) {
  if (!wanted()) return;
  if (channels_ != 3 && channels_ != 4)
    fail(Status::usage, "{}.channels is {}: 3 (RGB) or 4 (RGBA) expected", what, channels_);
  if (type_ != VSPLAT_PIXELS_F32 && type_ != VSPLAT_PIXELS_F16 && type_ != VSPLAT_PIXELS_U8)
    fail(Status::usage, "{}.type is {}, not a value of vsplat_pixel_type", what, type_);
  if (premultiplied_ && channels_ == 3)
    fail(Status::usage, "{}.premultiplied is {}: there is no alpha, channels is 3", what, picture.premultiplied);
  row_ = static_cast<std::size_t>(width) * static_cast<std::size_t>(channels_) * bytes_of(type_);
  row_bytes_ = picture.row_bytes ? picture.row_bytes : row_;
  if (row_bytes_ < row_)
    fail(Status::usage, "{}.row_bytes is {}: a row of {} pixels with {} channels has {} bytes", what, row_bytes_, width,
         channels_, row_);
  bytes_of_rows(static_cast<std::size_t>(height), row_, row_bytes_, picture.data_bytes, what);
}

void CallersPixels::add_to(Outputs& outputs, const std::string& name) const {
  if (!wanted()) return;
  const auto rows = static_cast<std::size_t>(height_);
  if (row_bytes_ == row_) return outputs.add(data_, rows * row_, name);
  for (std::size_t y = 0; y < rows; ++y) outputs.add(data_ + y * row_bytes_, row_, name);
}

void CallersPixels::write(const float* colour, const float* alpha, const float (&background)[3]) const {
  const auto n = static_cast<std::size_t>(width_), channels = static_cast<std::size_t>(channels_);
  std::array<float, 4> pixel{};
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
    unsigned char* to = data_ + y * row_bytes_;  // may begin at any address, so values are copied
    for (std::size_t x = 0; x < n; ++x, to += channels * bytes_of(type_)) {
      const float* seen = colour + 3 * (y * n + x);
      if (channels == 4) {
        const float a = std::clamp(alpha[y * n + x], 0.0f, 1.0f), scale = premultiplied_ ? 1.0f : a > 0 ? 1 / a : 0.0f;
        for (std::size_t c = 0; c < 3; ++c) pixel[c] = (seen[c] - (1 - a) * background[c]) * scale;
        pixel[3] = a;
      } else {
        std::copy_n(seen, 3, pixel.begin());
      }
      for (std::size_t c = 0; c < channels; ++c) {
        if (type_ == VSPLAT_PIXELS_U8) {
          to[c] = rounded_to_8_bits(pixel[c]);
        } else if (type_ == VSPLAT_PIXELS_F16) {
          const std::uint16_t half = to_half(pixel[c]);
          std::memcpy(to + 2 * c, &half, sizeof half);
        } else {
          std::memcpy(to + 4 * c, &pixel[c], sizeof pixel[c]);
        }
      }
    }
  }
}

}  // namespace vsplat::api
