// The one thing of a picture's EXIF data that matters here: how the picture is to be turned.
#pragma once
#include <cstddef>

namespace vsplat {

// `data` begins with a TIFF header ("II" or "MM"), as PNG's and WebP's chunks do and JPEG's after "Exif\0\0". 1 to 8 as
// EXIF numbers them; 1, for as it is stored, where there is none, or one that is damaged.
int exif_orientation(const unsigned char* data, std::size_t size);

}  // namespace vsplat
