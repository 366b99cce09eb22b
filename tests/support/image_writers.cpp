#include "tests/support/image_writers.h"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>
#include <png.h>

#include <cstddef>
#include <cstdio>
#include <stdexcept>
// clang-format off: libjpeg's header needs those above
#include <jpeglib.h>
// clang-format on

namespace vsplat {
namespace {

int png_channels(int colour_type) {
  switch (colour_type) {
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      return 2;
    case PNG_COLOR_TYPE_RGB:
      return 3;
    case PNG_COLOR_TYPE_RGB_ALPHA:
      return 4;
    default:
      return 1;
  }
}

std::vector<std::uint8_t> packed_row(const std::uint16_t* samples, std::size_t count, int depth) {
  std::vector<std::uint8_t> row((count * depth + 7) / 8);
  for (std::size_t i = 0; i < count; ++i) {
    if (depth == 16) {
      row[2 * i] = static_cast<std::uint8_t>(samples[i] >> 8);
      row[2 * i + 1] = static_cast<std::uint8_t>(samples[i] & 255);
    } else {
      const std::size_t bit = i * depth;
      row[bit / 8] = static_cast<std::uint8_t>(row[bit / 8] | samples[i] << (8 - depth - bit % 8));
    }
  }
  return row;
}

}  // namespace

void write_test_png(const std::string& path, int width, int height, const std::vector<std::uint16_t>& samples,
                    const PngKind& kind) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (!file) throw std::runtime_error(path);
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_IHDR(png, info, width, height, kind.depth, kind.colour_type,
               kind.interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  std::vector<png_color> palette;
  for (std::size_t i = 0; i + 2 < kind.palette.size(); i += 3)
    palette.push_back({kind.palette[i], kind.palette[i + 1], kind.palette[i + 2]});
  if (!palette.empty()) png_set_PLTE(png, info, palette.data(), static_cast<int>(palette.size()));
  if (!kind.palette_alpha.empty())
    png_set_tRNS(png, info, kind.palette_alpha.data(), static_cast<int>(kind.palette_alpha.size()), nullptr);
  if (!kind.transparent.empty()) {
    png_color_16 key{};
    key.gray = kind.transparent[0];
    if (kind.transparent.size() == 3) {
      key.red = kind.transparent[0];
      key.green = kind.transparent[1];
      key.blue = kind.transparent[2];
    }
    png_set_tRNS(png, info, nullptr, 0, &key);
  }
  png_write_info(png, info);
  const std::size_t count = static_cast<std::size_t>(width) * png_channels(kind.colour_type);
  std::vector<std::vector<std::uint8_t>> rows;
  std::vector<png_bytep> pointers;
  for (int y = 0; y < height; ++y) rows.push_back(packed_row(&samples[count * y], count, kind.depth));
  for (auto& row : rows) pointers.push_back(row.data());
  png_write_image(png, pointers.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

void write_test_jpeg(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint8_t>& samples, bool progressive) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (!file) throw std::runtime_error(path);
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, file);
  jpeg.image_width = static_cast<JDIMENSION>(width);
  jpeg.image_height = static_cast<JDIMENSION>(height);
  jpeg.input_components = channels;
  jpeg.in_color_space = channels == 1 ? JCS_GRAYSCALE : channels == 3 ? JCS_RGB : JCS_CMYK;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  if (progressive) jpeg_simple_progression(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  for (int y = 0; y < height; ++y) {
    JSAMPROW row = const_cast<JSAMPROW>(&samples[static_cast<std::size_t>(y) * width * channels]);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::fclose(file);
}

void write_jpeg_of_many_scans(const std::string& path, int side) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, file);
  jpeg.image_width = jpeg.image_height = static_cast<JDIMENSION>(side);
  jpeg.input_components = 1;
  jpeg.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&jpeg);
  std::vector<jpeg_scan_info> scans = {{1, {0}, 0, 0, 0, 0}};  // components, first and last coefficient, bits
  for (int bit = 1; bit >= 0; --bit)
    for (int k = 1; k < 64; ++k) scans.push_back({1, {0}, k, k, bit == 1 ? 0 : 1, bit});
  jpeg.scan_info = scans.data();
  jpeg.num_scans = static_cast<int>(scans.size());
  jpeg_start_compress(&jpeg, TRUE);
  std::vector<std::uint8_t> row(static_cast<std::size_t>(side));
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) row[static_cast<std::size_t>(x)] = static_cast<std::uint8_t>(x * y);
    JSAMPROW rows = row.data();
    jpeg_write_scanlines(&jpeg, &rows, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::fclose(file);
}

void write_test_exr(const std::string& path, int width, int height, const std::vector<std::string>& names,
                    const std::vector<std::vector<float>>& planes, const ExrKind& kind) {
  const Imath::Box2i data({kind.data_x, kind.data_y}, {kind.data_x + width - 1, kind.data_y + height - 1});
  const Imath::Box2i display = kind.display_w ? Imath::Box2i({0, 0}, {kind.display_w - 1, kind.display_h - 1}) : data;
  Imf::Header header(display, data);
  header.compression() = static_cast<Imf::Compression>(kind.compression);
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  std::vector<std::vector<half>> halves;
  Imf::FrameBuffer buffer;
  for (const auto& plane : planes) halves.emplace_back(plane.begin(), plane.end());
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (planes[i].size() != pixels) throw std::runtime_error("plane's size");
    const Imf::PixelType type = kind.half ? Imf::HALF : Imf::FLOAT;
    const std::size_t size = kind.half ? sizeof(half) : sizeof(float);
    const void* base = kind.half ? static_cast<const void*>(halves[i].data()) : planes[i].data();
    header.channels().insert(names[i], Imf::Channel(type));
    buffer.insert(names[i], Imf::Slice::Make(type, base, data, size, size * width));
  }
  if (kind.tiled) {
    header.setTileDescription(Imf::TileDescription(8, 8));
    Imf::TiledOutputFile out(path.c_str(), header, 0);
    out.setFrameBuffer(buffer);
    out.writeTiles(0, out.numXTiles() - 1, 0, out.numYTiles() - 1);
  } else {
    Imf::OutputFile out(path.c_str(), header, 0);
    out.setFrameBuffer(buffer);
    out.writePixels(height);
  }
}

}  // namespace vsplat
