// Writes TIFF, WebP and BMP pictures and adds EXIF data, which the library reads but does not write.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat::test {

struct TiffKind {
  int depth = 8;        // 8 or 16 bits
  int compression = 1;  // COMPRESSION_NONE
  bool tiled = false;   // else by strips of 4 rows
  bool planes = false;  // one after the other, else interleaved
  bool big_endian = false;
  bool associated = false;  // alpha: the colours are multiplied by it
  int orientation = 1;
};

// `samples`: [height][width][channels], channels 1, 3 or 4.
void write_test_tiff(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint16_t>& samples, const TiffKind& kind = {});

// `samples`: [height][width][channels], channels 3 or 4; without loss at quality 0. `exif`: a chunk, unless empty.
void write_test_webp(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint8_t>& samples, int quality = 0, const std::string& exif = "");

// An animation of `frames` pictures of one colour.
void write_animated_webp(const std::string& path, int width, int height, int frames);

// `samples`: [height][width][channels], channels 1 (as a palette of greys), 3, or 4.
void write_test_bmp(const std::string& path, int width, int height, int channels,
                    const std::vector<std::uint8_t>& samples, bool top_down = false);

// EXIF data that state an orientation and nothing else.
std::string exif_data(int orientation, bool big_endian = false);
// EXIF data that state a camera's model and a focal length in millimetres.
std::string lens_exif_data(const std::string& model, int focal);
// The JPEG file with these data, in a segment of its own.
void add_exif_to_jpeg(const std::string& path, const std::string& exif);

}  // namespace vsplat::test
