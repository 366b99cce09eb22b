// Bytes and pictures inside the text of a page.
#pragma once
#include <span>
#include <string>
#include <vsplat/vsplat.hpp>

namespace command {

std::string base64(std::span<const unsigned char> bytes);

// A picture's colours, [H,W,3], which another owns.
struct Colours {
  const float* values;
  int width, height;

  Colours(const float* of, int w, int h) : values(of), width(w), height(h) {}
  Colours(const vsplat::Picture& picture) : Colours(picture.colour.data(), picture.width, picture.height) {}
};

// A JPEG as a data URI, scaled down by whole factors so that the longer side has at most `longest` pixels. Makes no
// copy at the picture's own size.
std::string picture_uri(const Colours& picture, int longest = 640);
// The same of 4 x |difference| of two pictures of one size.
std::string difference_uri(const Colours& a, const Colours& b, int longest = 640);

}  // namespace command
