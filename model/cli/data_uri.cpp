#include "data_uri.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace command {
namespace {

std::size_t channel_at(const vsplat::Picture& picture, int x, int y, int c) {
  const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width);
  return 3 * (row + static_cast<std::size_t>(x)) + static_cast<std::size_t>(c);
}

// The mean of squares of factor x factor pixels; what is left at the far sides is dropped.
vsplat::Picture scaled_down(const vsplat::Picture& from, int longest) {
  const int factor = (std::max(from.width, from.height) + longest - 1) / longest;
  if (factor <= 1) return from;
  vsplat::Picture out(std::max(1, from.width / factor), std::max(1, from.height / factor));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < 3 * out.width; ++x) {
      float sum = 0;
      int count = 0;
      for (int v = y * factor; v < std::min((y + 1) * factor, from.height); ++v)
        for (int u = x / 3 * factor; u < std::min((x / 3 + 1) * factor, from.width); ++u, ++count)
          sum += from.colour[channel_at(from, u, v, x % 3)];
      out.colour[channel_at(out, x / 3, y, x % 3)] = sum / static_cast<float>(count);
    }
  return out;
}

}  // namespace

std::string base64(std::span<const unsigned char> bytes) {
  static constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t three = 0;
    for (std::size_t k = 0; k < 3; ++k) three = three << 8 | (k < count ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) out += k <= count ? letters[three >> (18 - 6 * k) & 63] : '=';
  }
  return out;
}

std::string picture_uri(const vsplat::Picture& picture, int longest) {
  return "data:image/jpeg;base64," + base64(scaled_down(picture, longest).save_memory(VSPLAT_PICTURE_JPEG));
}

}  // namespace command
