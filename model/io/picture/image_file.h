// Reads pictures from PNG, JPEG, EXR, TIFF, WebP and BMP files (identified by content, never by name) and writes PNG,
// JPEG and EXR.
// Files that are cut off, damaged or too large throw Error(format) with the path; files that cannot be opened throw
// Error(file).
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "model/base/image.h"
#include "model/base/pixel_rows.h"

namespace vsplat {

// Larger pictures are refused before any memory is allocated for them.
inline constexpr long max_image_pixels = 1L << 28;
inline constexpr long max_image_side = 65535;

// The contents of a picture's header.
struct ImageInfo {
  int width = 0, height = 0;
  bool alpha = false;   // the picture is read with four channels, otherwise with three
  int orientation = 1;  // EXIF (or TIFF) orientation for display, 1 to 8; 1: as stored
  // Bytes that decoding holds at once besides the file and some rows: the whole picture if the format is not decoded by
  // rows.
  double held = 0;
  std::string lens = {};  // what took it, as in ExifFacts
};

// A picture file, read completely by the constructor. It is not opened again, so info() and decode() see the same
// picture even if the file changes.
class ImageFile {
 public:
  explicit ImageFile(const std::string& path);

  ImageInfo info() const;
  // Like read_image(), then transformed by `orientation` (1 to 8). Every call decodes the file.
  Image decode(int orientation = 1) const;
  // Row by row; this object must outlive the rows. Error(memory) if the host budget (runtime/system/host_memory.h) has
  // less left than the format, or the rotation, must hold at once.
  std::unique_ptr<PixelRows> rows(int orientation = 1) const;

 private:
  std::string path_;
  std::vector<unsigned char> bytes_;
};

// Reads the beginning of the file: 64 KiB, or more if the header is longer.
ImageInfo read_image_info(const std::string& path);

// Three channels, or four (straight alpha) if the file has transparency; grey is copied to three channels. Colour is
// sRGB-encoded, [0,1]; EXR's linear, premultiplied values are divided by alpha and encoded. TIFF: the first picture, as
// 8 bits. Gamma tags and orientations are ignored.
Image read_image(const std::string& path);
// A mask: one channel, luma times alpha if there is alpha.
Image read_mask(const std::string& path);
Image mask_of(const Image& picture);
class MaskRows : public PixelRows {
 public:
  // `picture` has three or four channels and must outlive this.
  explicit MaskRows(PixelRows& picture) : PixelRows(picture.width, picture.height, 1), picture_(picture) {}
  void next(float* row) override;

 private:
  PixelRows& picture_;
  std::vector<float> pixels_;  // one row
};

// Writes 8 bits: colour (3 channels), colour with straight alpha (4) or grey (1). Values are round(255 * value clamped
// to [0,1]); NaN is written as 0.
void write_png(const std::string& path, const Image& image);

// Writes colour (3 channels), rounded as by write_png(), without chroma subsampling; `quality` is 1 to 100 on libjpeg's
// scale. Error(usage) for another quality, Error(input) for a side beyond JPEG's 65500 pixels.
void write_jpeg(const std::string& path, const Image& image, int quality);

// A 16-bit grey PNG of thousandths of a unit, rounded; 0 for what is not above 0, and at most 65535.
void write_depth_png(const std::string& path, const Image& depth);

// A layer of an EXR: channel NAME.Z, or NAME.X, NAME.Y and NAME.Z for three.
struct PictureLayer {
  std::string name;
  Image values;
};

// Inputs: `colour` [H][W][3], sRGB-encoded, accumulated over black (thus premultiplied); `alpha` and `depth` [H][W][1],
// as accumulated. Writes half R, G, B (linear light, premultiplied) and A, and float Z = depth / alpha, +infinity where
// alpha is 0. Layers, of the same size, are written unchanged as float.
void write_exr(const std::string& path, const Image& colour, const Image& alpha, const Image& depth,
               const std::vector<PictureLayer>& layers = {});

// Writes all three unchanged as float: `colour` over its background, without a transfer curve; Z not divided by alpha.
void write_exr_raw(const std::string& path, const Image& colour, const Image& alpha, const Image& depth,
                   const std::vector<PictureLayer>& layers = {});

float srgb_encode(float linear);
float srgb_decode(float encoded);

}  // namespace vsplat
