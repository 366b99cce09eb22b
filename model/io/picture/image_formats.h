// What image_file.cpp calls for each format. The path is only for messages. What decodes needs the whole file; the
// `_info` functions may be given its beginning and throw Error(format) where the header is not complete in it.
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

// A file's rows as they are stored. What they are read from must outlive them; errors are those of image_file.h, found
// at the latest with the last row. Whatever is held beyond some rows is reserved of the host's memory (Error(memory)).
class FileRows : public PixelRows {
 public:
  FileRows(const ImageInfo& info, int bits_) : PixelRows(info.width, info.height, info.alpha ? 4 : 3), bits(bits_) {}

  const int bits;  // of a value: multiples of 1/255 (8) or of 1/65535 (16), or any number (32)
};

std::unique_ptr<FileRows> open_picture(const FileBytes& file);  // whichever it is
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
std::unique_ptr<FileRows> open_tiff(const FileBytes& file);
// The same with another limit on the bytes that decoding may hold, the file's with them: parts of a long strip are
// unpacked one after the other.
std::unique_ptr<FileRows> open_tiff_within(const FileBytes& file, double most);
std::unique_ptr<FileRows> open_webp(const FileBytes& file);
std::unique_ptr<FileRows> open_bmp(const FileBytes& file);

// What a decoder holds, reserved. Of what holds more than 256 MiB there is one at a time, and other threads wait: it
// belongs to the thread that it was made in, which may have several.
struct DecodingRoom {
  std::unique_lock<std::recursive_mutex> turn;
  HostMemory held;
};
// Of `info.held` bytes.
DecodingRoom room_to_decode(const FileBytes& file, const ImageInfo& info);

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
