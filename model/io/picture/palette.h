// Reduces a picture to 256 colours, for GIF.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

namespace vsplat {

struct IndexedPicture {
  using Colour = std::array<std::uint8_t, 3>;
  std::vector<Colour> palette;  // 2 to 256
  std::vector<std::uint8_t> pixels;
};

// `pixels` in rows of `width`. The palette is made for this picture; errors are diffused to the neighbours (Floyd and
// Steinberg, 1976). The first pixel's colour is exact: it is the background's, which stays plain.
IndexedPicture indexed(const std::vector<IndexedPicture::Colour>& pixels, int width);

}  // namespace vsplat
