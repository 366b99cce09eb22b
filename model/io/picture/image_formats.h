// The functions of each format that image_file.cpp calls. The path is only for messages. Decoding needs the whole file.
// The `_info` functions also accept the beginning of a file and throw Error(format) if the header is incomplete.
#pragma once
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "model/base/pixel_rows.h"
#include "model/io/picture/image_file.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

struct FileBytes {
  const std::string& path;
  const unsigned char* data;
  std::size_t size;
};

// A file's rows as stored. The file's bytes must outlive them. Errors are those of image_file.h, thrown with the last
// row at the latest. Memory beyond a few rows is reserved from the host budget (Error(memory)).
class FileRows : public PixelRows {
 public:
  FileRows(const ImageInfo& info, int bits_) : PixelRows(info.width, info.height, info.alpha ? 4 : 3), bits(bits_) {}

  const int bits;  // of a value: multiples of 1/255 (8) or of 1/65535 (16), or any number (32)
};

std::unique_ptr<FileRows> open_picture(const FileBytes& file);  // of any format
Image decode_image(const FileBytes& file);

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

std::unique_ptr<FileRows> open_png(const FileBytes& file);
std::unique_ptr<FileRows> open_jpeg(const FileBytes& file);
std::unique_ptr<FileRows> open_exr(const FileBytes& file);
// The channel Z, else the only one, as stored, three times.
std::unique_ptr<FileRows> open_exr_depth(const FileBytes& file);
std::unique_ptr<FileRows> open_tiff(const FileBytes& file);
// As open_tiff() with another limit on the bytes that decoding may hold, including the file. A long strip is then
// unpacked in pieces.
std::unique_ptr<FileRows> open_tiff_within(const FileBytes& file, double most);
std::unique_ptr<FileRows> open_webp(const FileBytes& file);
std::unique_ptr<FileRows> open_bmp(const FileBytes& file);

// Memory reserved for a decoder. Only one decoder with more than 256 MiB runs at a time; other threads wait. The lock
// belongs to the thread that took it, which may hold several.
struct DecodingMemory {
  std::unique_lock<std::recursive_mutex> turn;
  HostMemory held;
};
// Reserves `info.held` bytes.
DecodingMemory memory_to_decode(const FileBytes& file, const ImageInfo& info);

// round(255 * value clamped to [0,1]), NaN as 0: the values of every 8-bit format.
std::vector<unsigned char> rounded(const Image& image);
// 1, 3 or 4 channels.
std::vector<unsigned char> encode_png(const Image& image);
// 1 channel, 16 bits: the values rounded and clamped to 0 to 65535, NaN as 0.
std::vector<unsigned char> encode_png_16(const Image& image);
// 3 channels; baseline, without chroma subsampling. `path` is for messages.
std::vector<unsigned char> encode_jpeg(const std::string& path, const Image& image, int quality);
// Channels R, G, B, A in float or half, and float Z and layers, by scanlines with ZIP compression. rgba [H][W][4],
// z [H][W][1].
std::vector<unsigned char> encode_exr(const Image& rgba, const Image& z, bool half_colour,
                                      const std::vector<PictureLayer>& layers);

// Throws Error(format) unless 1 <= width, height <= max_image_side and width * height <= max_image_pixels.
void check_image_size(const std::string& path, long width, long height);

}  // namespace vsplat
