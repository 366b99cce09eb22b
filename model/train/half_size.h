// Views that the loss looks at in half the size, so that scenes are learnt that look right from farther away, too: a
// Gaussian is drawn with a third of a pixel more than it has (0.3 square pixels), which is more of the object the fewer
// pixels show it.
#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "model/base/camera.h"

namespace vsplat {

// Whether a view of an object is one of them: of so large a share, by the seed, the step's draw and the view alone.
bool is_half_size(double share, std::uint64_t seed, std::uint32_t draw, std::string_view object, long view);

// The camera of the picture whose pixels are means of four.
Camera half_size(Camera camera);

// Means of 2 x 2 pixels of a picture [side, side, channels]; `side` is even.
std::vector<float> half_size(const float* picture, long side, long channels);
// Rounded.
std::vector<std::uint8_t> half_size(const std::vector<std::uint8_t>& picture, long side, long channels);

}  // namespace vsplat
