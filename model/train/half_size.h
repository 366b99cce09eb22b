// Views whose loss is computed at half size, so that the learnt scenes also look right from farther away. The
// renderer's low-pass filter widens each Gaussian by a third of a pixel (0.3 square pixels), which is a larger part of
// an object that few pixels show.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// Whether this view of an object is rendered at half size, with a probability of `share`. Depends on the seed, the
// step's draw, the object and the view alone.
bool is_half_size(double share, std::uint64_t seed, std::uint32_t draw, std::string_view object, long view);

// The camera of the picture downsampled by 2.
Camera half_size(Camera camera);

// Means of 2 x 2 pixels of a picture [side, side, channels]. `side` must be even.
std::vector<float> half_size(const float* picture, long side, long channels);
// The same for 8-bit pictures, rounded.
std::vector<std::uint8_t> half_size(const std::vector<std::uint8_t>& picture, long side, long channels);

}  // namespace vsplat
