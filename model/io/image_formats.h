// What image_file.cpp calls for each format. The path is only for messages. What decodes needs the whole file; the
// `_info` functions may be given its beginning and throw Error(format) where the header is not complete in it.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

#include "model/io/image_file.h"

namespace vsplat {

struct FileBytes {
  const std::string& path;
  const unsigned char* data;
  std::size_t size;
};

Image decode_image(const FileBytes& file);  // whichever it is

bool is_png(const FileBytes& file);
bool is_jpeg(const FileBytes& file);
bool is_exr(const FileBytes& file);
bool is_tiff(const FileBytes& file);
bool is_webp(const FileBytes& file);
bool is_bmp(const FileBytes& file);

ImageInfo png_info(const FileBytes& file);
ImageInfo jpeg_info(const FileBytes& file);
ImageInfo exr_info(const FileBytes& file);
ImageInfo tiff_info(const FileBytes& file);
ImageInfo webp_info(const FileBytes& file);
ImageInfo bmp_info(const FileBytes& file);

Image decode_png(const FileBytes& file);
Image decode_jpeg(const FileBytes& file);
Image decode_exr(const FileBytes& file);
Image decode_tiff(const FileBytes& file);
Image decode_webp(const FileBytes& file);
Image decode_bmp(const FileBytes& file);

// round(255 * value clamped to [0,1]), NaN as 0: what every 8-bit format takes.
std::vector<unsigned char> rounded(const Image& image);
// 1, 3 or 4 channels.
std::vector<unsigned char> encode_png(const Image& image);
// 3 channels, baseline, colours at full resolution. `path` is for messages.
std::vector<unsigned char> encode_jpeg(const std::string& path, const Image& image, int quality);
// Channels R, G, B, A in float or half, and float Z, by scanlines with ZIP. rgba [H][W][4], z [H][W][1].
std::vector<unsigned char> encode_exr(const Image& rgba, const Image& z, bool half_colour);

// Throws Error(format) unless 1 <= width, height <= max_image_side and width * height <= max_image_pixels.
void check_image_size(const std::string& path, long width, long height);

}  // namespace vsplat
