// Pictures in files: PNG, JPEG, EXR, TIFF, WebP and BMP in (told apart by content, never by name), PNG, JPEG and EXR
// out.
// Files that are cut off, damaged or too large throw Error(format) naming the path; files that cannot be opened,
// Error(file).
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// A larger picture is refused before anything is allocated for it.
inline constexpr long max_image_pixels = 1L << 28;
inline constexpr long max_image_side = 65535;

// What a picture's header says.
struct ImageInfo {
  int width = 0, height = 0;
  bool alpha = false;   // it is read with four channels, else with three
  int orientation = 1;  // how EXIF (or TIFF) says that it is to be shown, 1 to 8; 1: as it is stored
  // Bytes that decoding holds at once beside the file and some rows: all of it where its format is not decoded by rows.
  double held = 0;
};

// A picture's file, read as a whole when this is made. Nothing opens the file again, so that what is asked first and
// what is decoded later is one picture, however often the file changes.
class ImageFile {
 public:
  explicit ImageFile(const std::string& path);

  ImageInfo info() const;
  // As read_image(), and as `orientation` (1 to 8) says that what is stored is to be shown; decodes with every call.
  Image decode(int orientation = 1) const;
  // The same row by row. This must outlive it. Error(memory) where what the format, or turning it, needs to hold at
  // once is more than the host's budget leaves (runtime/system/host_memory.h).
  std::unique_ptr<PixelRows> rows(int orientation = 1) const;

 private:
  std::string path_;
  std::vector<unsigned char> bytes_;
};

// Reads the file's beginning: 64 KiB, and more only where the header is longer than that.
ImageInfo read_image_info(const std::string& path);

// Three channels, or four where the file has transparency (straight alpha); grey is spread over the three. Colour is
// sRGB-encoded, [0,1]: EXR's linear, premultiplied values are divided by alpha and encoded. TIFF is read as 8 bits, its
// first picture. Gamma tags are ignored, and pictures stay as they are stored, whatever orientation they state.
Image read_image(const std::string& path);
// A mask: one channel, the picture's luma, times its alpha where it has one.
Image read_mask(const std::string& path);
Image mask_of(const Image& picture);
class MaskRows : public PixelRows {
 public:
  // Of a picture of three or four channels, which must outlive this.
  explicit MaskRows(PixelRows& picture) : PixelRows(picture.width, picture.height, 1), picture_(picture) {}
  void next(float* row) override;

 private:
  PixelRows& picture_;
  std::vector<float> pixels_;  // a row
};

// 8 bits, colour (3 channels), with straight alpha (4) or grey (1): round(255 * value clamped to [0,1]); NaN is written
// as 0.
void write_png(const std::string& path, const Image& image);

// Colour (3 channels), rounded as write_png() does, `quality` 1 to 100 on libjpeg's scale, without loss of resolution
// in the colours. Error(usage) for another quality, Error(input) for a side beyond the 65500 pixels that JPEG holds.
void write_jpeg(const std::string& path, const Image& image, int quality);

// `colour` [H][W][3] is sRGB-encoded and accumulated over black (so premultiplied), `alpha` and `depth` [H][W][1] as
// accumulated. Written: half R, G, B (linear light, premultiplied) and A, float Z = depth / alpha, +infinity where
// alpha is 0.
void write_exr(const std::string& path, const Image& colour, const Image& alpha, const Image& depth);

// The three as they are, in float: `colour` over whatever background it was drawn on, without any curve; Z undivided.
void write_exr_raw(const std::string& path, const Image& colour, const Image& alpha, const Image& depth);

float srgb_encode(float linear);
float srgb_decode(float encoded);

}  // namespace vsplat
