// Planes of bytes as lossless WebP pictures: RGBA, one texel an entry, row by row.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat {

inline constexpr int kWidestPlane = 16383;  // texels to a side of a WebP

struct WebpPlane {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;  // [height][width][4]

  std::size_t texels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
  const std::uint8_t* at(std::size_t texel) const { return &rgba[4 * texel]; }
};

// `what` begins messages: the path and the plane's name. Error(format) for a damaged, cut-off or animated WebP, and for
// one of fewer than `least` or more than `most` texels, before anything is decoded. Error(memory) beyond the host
// budget.
WebpPlane decode_webp_plane(const std::string& what, const std::vector<unsigned char>& bytes, std::size_t least,
                            std::size_t most);

// Exact, also for texels whose fourth byte is 0. The same plane gives the same bytes.
std::vector<unsigned char> encode_webp_plane(const WebpPlane& plane);

}  // namespace vsplat
