// Reads the orientation from a picture's EXIF data; nothing else in it is needed.
#pragma once
#include <cstddef>

namespace vsplat {

// `data` begins with a TIFF header ("II" or "MM"), as in PNG's and WebP's chunks and in JPEG after "Exif\0\0". Returns
// 1 to 8 as EXIF numbers orientations; 1 (as stored) if there is none or the data are damaged.
int exif_orientation(const unsigned char* data, std::size_t size);

}  // namespace vsplat
