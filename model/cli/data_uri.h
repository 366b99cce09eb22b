// Bytes and pictures inside the text of a page.
#pragma once
#include <span>
#include <string>
#include <vsplat/vsplat.hpp>

namespace command {

std::string base64(std::span<const unsigned char> bytes);

// A JPEG as a data URI, scaled down by whole factors so that the longer side has at most `longest` pixels.
std::string picture_uri(const vsplat::Picture& picture, int longest = 640);

}  // namespace command
