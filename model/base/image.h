// A picture in host memory.
#pragma once
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat {

// [height][width][channels]. Colour is sRGB-encoded in [0,1] unless a comment says otherwise.
struct Image {
  int width = 0, height = 0, channels = 0;
  std::vector<float> data;

  Image() = default;
  Image(int w, int h, int c, float value = 0.0f)
      : width(w), height(h), channels(c), data(static_cast<std::size_t>(w) * h * c, value) {}

  float* at(int x, int y) { return &data[(static_cast<std::size_t>(y) * width + x) * channels]; }
  const float* at(int x, int y) const { return &data[(static_cast<std::size_t>(y) * width + x) * channels]; }
  bool empty() const { return data.empty(); }
};

// A value of [0,1] in 8 bits.
inline std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
}

}  // namespace vsplat
