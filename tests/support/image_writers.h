// Writes picture files that the library reads but does not write, directly with libpng, libjpeg and OpenEXR.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace vsplat {

struct PngKind {
  int colour_type;  // PNG_COLOR_TYPE_...
  int depth = 8;
  bool interlaced = false;
  std::vector<std::uint8_t> palette = {};        // r g b ...
  std::vector<std::uint8_t> palette_alpha = {};  // tRNS of a palette
  std::vector<std::uint16_t> transparent = {};   // tRNS: one grey, or r g b
};

// `samples`: [height][width][channels], packed to `depth` bits here.
void write_test_png(const std::string& path, int width, int height, const std::vector<std::uint16_t>& samples,
                    const PngKind& kind);

// `samples`: [height][width][channels], channels 1, 3 or 4 (CMYK).
void write_test_jpeg(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint8_t>& samples, bool progressive = false);

// Grey, progressive, with every coefficient in two separate scans: visits the picture 127 times.
void write_jpeg_of_many_scans(const std::string& path, int side);

struct ExrKind {
  bool half = false, tiled = false;
  int data_x = 0, data_y = 0;        // the data window's corner; its size is the picture's
  int display_w = 0, display_h = 0;  // 0: as the data window
  int compression = 3;               // Imf::ZIP_COMPRESSION
};

// `planes`: one [height][width] plane per name.
void write_test_exr(const std::string& path, int width, int height, const std::vector<std::string>& names,
                    const std::vector<std::vector<float>>& planes, const ExrKind& kind);

}  // namespace vsplat
