#include "data_uri.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "difference.h"

namespace command {
namespace {

std::size_t channel_at(int width, int x, int y, int c) {
  const auto row = static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  return 3 * (row + static_cast<std::size_t>(x)) + static_cast<std::size_t>(c);
}

// The means of squares of factor x factor pixels of a picture whose value i is value(i); what is left at the far sides
// is dropped.
template <class Value>
vsplat::Picture scaled_down(int width, int height, int longest, const Value& value) {
  const int factor = std::max(1, (std::max(width, height) + longest - 1) / longest);
  vsplat::Picture out(std::max(1, width / factor), std::max(1, height / factor));
  for (int y = 0; y < out.height; ++y)
    for (int x = 0; x < 3 * out.width; ++x) {
      float sum = 0;
      int count = 0;
      for (int v = y * factor; v < std::min((y + 1) * factor, height); ++v)
        for (int u = x / 3 * factor; u < std::min((x / 3 + 1) * factor, width); ++u, ++count)
          sum += value(channel_at(width, u, v, x % 3));
      out.colour[channel_at(out.width, x / 3, y, x % 3)] = sum / static_cast<float>(count);
    }
  return out;
}

std::string uri_of(const vsplat::Picture& picture) {
  return "data:image/jpeg;base64," + base64(picture.save_memory(VSPLAT_PICTURE_JPEG));
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

std::string picture_uri(const Colours& picture, int longest) {
  return uri_of(scaled_down(picture.width, picture.height, longest, [&](std::size_t i) { return picture.values[i]; }));
}

std::string difference_uri(const Colours& a, const Colours& b, int longest) {
  return uri_of(scaled_down(a.width, a.height, longest,
                            [&](std::size_t i) { return shown_difference(a.values[i], b.values[i]); }));
}

}  // namespace command
