// Small text in pictures: printable ASCII in X11's fixed font of 6 x 10 pixels (misc-fixed, in the public domain).
#pragma once
#include <string>

#include "model/base/image.h"

namespace vsplat {

inline constexpr int glyph_width = 6, glyph_height = 10;

// As much of `text` as goes into `width` pixels, ending in ".." where that is not all of it.
std::string fitted_text(const std::string& text, int width);

// Sets the glyphs' pixels to `grey` in all channels, the first glyph's upper-left corner at x, y; pixels outside the
// picture are left out. A byte that is not printable ASCII becomes a question mark.
void draw_text(Image& image, int x, int y, const std::string& text, float grey);

}  // namespace vsplat
