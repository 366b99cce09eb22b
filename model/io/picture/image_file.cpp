#include "model/io/picture/image_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <new>

#include "model/io/foreign_file.h"
#include "model/io/picture/image_formats.h"
#include "model/io/picture/oriented_rows.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/host_span.h"

namespace vsplat {
namespace {

struct Format {
  bool (*is)(const FileBytes&);
  ImageInfo (*info)(const FileBytes&);
  std::unique_ptr<FileRows> (*open)(const FileBytes&);
};
constexpr Format formats[] = {{is_png, png_info, open_png},    {is_jpeg, jpeg_info, open_jpeg},
                              {is_exr, exr_info, open_exr},    {is_tiff, tiff_info, open_tiff},
                              {is_webp, webp_info, open_webp}, {is_bmp, bmp_info, open_bmp}};

// Calls `read` of the format detected in `file`.
template <class T>
T by_format(const FileBytes& file, T (*Format::*read)(const FileBytes&)) {
  try {
    for (const Format& format : formats)
      if (format.is(file)) return (format.*read)(file);
  } catch (const std::bad_alloc&) {
    fail(Status::memory, "{}: not enough memory to decode the picture", file.path);
  }
  const std::size_t some = std::min<std::size_t>(file.size, 4096);
  const auto other = what_file_is(file.path, {reinterpret_cast<const char*>(file.data), some});
  const ForeignFile none{"none of the known picture formats"};
  fail(Status::format, "{}: {}", file.path,
       (other ? *other : none).where("a PNG, JPEG, EXR, TIFF, WebP or BMP picture"));
}

ImageInfo info_of(const FileBytes& file) { return by_format(file, &Format::info); }

// All rows, if the memory budget allows it.
Image whole(const FileBytes& file, PixelRows& rows) {
  const DecodingMemory memory = memory_to_decode(
      file, {rows.width, rows.height, false, 1, static_cast<double>(rows.row_size()) * rows.height * sizeof(float)});
  return image_of(rows);
}

void check_planes(const char* what, const Image& colour, const Image& alpha, const Image& depth) {
  if (colour.channels != 3 || alpha.channels != 1 || depth.channels != 1 || colour.width != alpha.width ||
      colour.height != alpha.height || colour.width != depth.width || colour.height != depth.height || colour.empty())
    fail(Status::internal, "{}: colour is {} x {} x {}, alpha {} x {} x {}, depth {} x {} x {}", what, colour.width,
         colour.height, colour.channels, alpha.width, alpha.height, alpha.channels, depth.width, depth.height,
         depth.channels);
}

}  // namespace

void check_image_size(const std::string& path, long width, long height) {
  if (width < 1 || height < 1)
    fail(Status::format, "{}: the picture is {} x {} pixels, at least 1 x 1 is expected", path, width, height);
  if (width > max_image_side || height > max_image_side || width > max_image_pixels / height)
    fail(Status::format, "{}: the picture claims {} x {} pixels; at most {} to a side and {} in all are read", path,
         width, height, max_image_side, max_image_pixels);
}

std::vector<unsigned char> rounded(const Image& image) {
  std::vector<unsigned char> out(image.data.size());
  for (std::size_t i = 0; i < out.size(); ++i) {
    const float v = image.data[i] > 0 ? std::fmin(image.data[i], 1.0f) : 0.0f;  // NaN is not > 0
    out[i] = static_cast<unsigned char>(std::lround(255.0f * v));
  }
  return out;
}

DecodingMemory memory_to_decode(const FileBytes& file, const ImageInfo& info) {
  static std::recursive_mutex one;
  constexpr double large = 1u << 28;
  DecodingMemory out;
  if (info.held > large) out.turn = std::unique_lock(one);
  out.held = HostMemory(fmt::format("{}: decoding its {} x {} pixels", file.path, info.width, info.height), info.held);
  return out;
}

std::unique_ptr<FileRows> open_picture(const FileBytes& file) { return by_format(file, &Format::open); }

Image decode_image(const FileBytes& file) {
  const HostSpan span(HostKind::host, "decode pictures", file.path);
  const std::unique_ptr<FileRows> rows = open_picture(file);
  return whole(file, *rows);
}

ImageFile::ImageFile(const std::string& path) : path_(path), bytes_(read_file(path)) {}

ImageInfo ImageFile::info() const { return info_of({path_, bytes_.data(), bytes_.size()}); }

Image ImageFile::decode(int orientation) const {
  const HostSpan span(HostKind::host, "decode pictures", path_);
  const std::unique_ptr<PixelRows> all = rows(orientation);
  return whole({path_, bytes_.data(), bytes_.size()}, *all);
}

std::unique_ptr<PixelRows> ImageFile::rows(int orientation) const {
  const FileBytes file{path_, bytes_.data(), bytes_.size()};
  std::unique_ptr<FileRows> stored = open_picture(file);
  if (orientation <= 1) return stored;
  return std::make_unique<OrientedRows>(file, *stored, orientation);
}

ImageInfo read_image_info(const std::string& path) {
  InputFile file(path);
  std::vector<unsigned char> bytes;
  for (std::size_t step = std::size_t{1} << 16;; step *= 8) {
    file.read(step, bytes);
    try {
      return info_of({path, bytes.data(), bytes.size()});
    } catch (const Error&) {
      if (file.at_end()) throw;  // otherwise the header may continue beyond the bytes read so far
    }
  }
}

Image read_image(const std::string& path) { return ImageFile(path).decode(); }

Image read_mask(const std::string& path) { return mask_of(read_image(path)); }

Image mask_of(const Image& picture) {
  ImageRows pixels(picture);
  MaskRows rows(pixels);
  return image_of(rows);
}

void MaskRows::next(float* row) {
  pixels_.resize(picture_.row_size());
  picture_.next(pixels_.data());
  const float* p = pixels_.data();
  for (int x = 0; x < width; ++x, p += picture_.channels) {
    // Grey values stay identical bit for bit; a weighted sum of three equal values might not.
    const float luma = p[0] == p[1] && p[1] == p[2] ? p[0] : 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
    row[x] = picture_.channels == 4 ? luma * p[3] : luma;
  }
}

void write_png(const std::string& path, const Image& image) {
  const std::vector<unsigned char> bytes = [&] {
    const HostSpan span(HostKind::host, "encode pictures", path);
    return encode_png(image);
  }();
  write_file(path, bytes.data(), bytes.size());
}

void write_depth_png(const std::string& path, const Image& depth) {
  constexpr float unit = 1000;
  Image steps = depth;
  for (float& v : steps.data) v *= unit;
  const std::vector<unsigned char> bytes = encode_png_16(steps);
  write_file(path, bytes.data(), bytes.size());
}

void write_jpeg(const std::string& path, const Image& image, int quality) {
  const std::vector<unsigned char> bytes = [&] {
    const HostSpan span(HostKind::host, "encode pictures", path);
    return encode_jpeg(path, image, quality);
  }();
  write_file(path, bytes.data(), bytes.size());
}

void write_exr(const std::string& path, const Image& colour, const Image& alpha, const Image& depth,
               const std::vector<PictureLayer>& layers) {
  check_planes("write_exr", colour, alpha, depth);
  Image rgba(colour.width, colour.height, 4), z(colour.width, colour.height, 1);
  for (std::size_t i = 0; i < z.data.size(); ++i) {
    const float a = alpha.data[i];
    const bool seen = a > 0;
    for (int c = 0; c < 3; ++c) rgba.data[4 * i + c] = seen ? srgb_decode(colour.data[3 * i + c] / a) * a : 0.0f;
    rgba.data[4 * i + 3] = seen ? a : 0.0f;
    z.data[i] = seen ? depth.data[i] / a : std::numeric_limits<float>::infinity();
  }
  const std::vector<unsigned char> bytes = encode_exr(rgba, z, true, layers);
  write_file(path, bytes.data(), bytes.size());
}

void write_exr_raw(const std::string& path, const Image& colour, const Image& alpha, const Image& depth,
                   const std::vector<PictureLayer>& layers) {
  check_planes("write_exr_raw", colour, alpha, depth);
  Image rgba(colour.width, colour.height, 4);
  for (std::size_t i = 0; i < alpha.data.size(); ++i) {
    for (int c = 0; c < 3; ++c) rgba.data[4 * i + c] = colour.data[3 * i + c];
    rgba.data[4 * i + 3] = alpha.data[i];
  }
  const std::vector<unsigned char> bytes = encode_exr(rgba, depth, false, layers);
  write_file(path, bytes.data(), bytes.size());
}

// IEC 61966-2-1. The curve continues beyond 1, so that decoding inverts encoding there as well.
// Computed in double, so that 1 stays 1.
float srgb_encode(float linear) {
  if (!(linear > 0.0031308f)) return 12.92f * linear;
  return static_cast<float>(1.055 * std::pow(static_cast<double>(linear), 1 / 2.4) - 0.055);
}

float srgb_decode(float encoded) {
  if (!(encoded > 0.04045f)) return encoded / 12.92f;
  return static_cast<float>(std::pow((static_cast<double>(encoded) + 0.055) / 1.055, 2.4));
}

}  // namespace vsplat
