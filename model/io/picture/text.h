// Draws small text into pictures: printable ASCII in X11's fixed font of 6 x 10 pixels (misc-fixed, public domain).
#pragma once
#include <string>

#include "model/base/image.h"

namespace vsplat {

inline constexpr int glyph_width = 6, glyph_height = 10;

// The beginning of `text` that fits into `width` pixels; ends in ".." if it was cut.
std::string fitted_text(const std::string& text, int width);

// Sets the glyphs' pixels to `grey` in all channels, with the first glyph's upper-left corner at x, y. Pixels outside
// the picture are skipped. Bytes that are not printable ASCII become question marks.
void draw_text(Image& image, int x, int y, const std::string& text, float grey);

}  // namespace vsplat
