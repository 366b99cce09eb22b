// Reads from a picture's EXIF data how it is turned and what took it; nothing else in it is needed.
#pragma once
#include <cstddef>
#include <string>

namespace vsplat {

struct ExifFacts {
  int orientation = 1;  // 1 to 8 as EXIF numbers them; 1: as stored
  std::string lens;     // maker, model, lens and focal lengths, separated by ", "; "" if not stated
};

// `data` begins with a TIFF header ("II" or "MM"), as in PNG's and WebP's chunks and in JPEG after "Exif\0\0". What is
// damaged counts as not stated.
ExifFacts read_exif(const unsigned char* data, std::size_t size);

}  // namespace vsplat
