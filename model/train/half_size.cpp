#include "model/train/half_size.h"

#include <string>

#include "model/base/rng.h"

namespace vsplat {
namespace {

// `half`: added to the sum of four before the division, to round integers; 0 for other types.
template <class T, class Sum>
std::vector<T> means_of_four(const T* picture, long side, long channels, Sum half, Sum four) {
  const long to = side / 2;
  std::vector<T> out;
  out.reserve(static_cast<std::size_t>(to * to * channels));
  for (long y = 0; y < to; ++y)
    for (long x = 0; x < to; ++x)
      for (long c = 0; c < channels; ++c) {
        const T* at = picture + (2 * y * side + 2 * x) * channels + c;
        const Sum sum = static_cast<Sum>(at[0]) + static_cast<Sum>(at[channels]) +
                        static_cast<Sum>(at[side * channels]) + static_cast<Sum>(at[(side + 1) * channels]);
        out.push_back(static_cast<T>((sum + half) / four));
      }
  return out;
}

}  // namespace

bool is_half_size(double share, std::uint64_t seed, std::uint32_t draw, std::string_view object, long view) {
  if (share <= 0) return false;
  const std::uint32_t stream = stream_of("half size " + std::string(object));
  return philox4x32_10({static_cast<std::uint32_t>(view), draw, stream, 0}, rng_key(seed))[0] < share * 0x1p32;
}

Camera half_size(Camera camera) {
  camera.width /= 2, camera.height /= 2;
  camera.fx /= 2, camera.fy /= 2, camera.cx /= 2, camera.cy /= 2;
  return camera;
}

std::vector<float> half_size(const float* picture, long side, long channels) {
  return means_of_four<float, float>(picture, side, channels, 0, 4);
}

std::vector<std::uint8_t> half_size(const std::vector<std::uint8_t>& picture, long side, long channels) {
  return means_of_four<std::uint8_t, int>(picture.data(), side, channels, 2, 4);
}

}  // namespace vsplat
