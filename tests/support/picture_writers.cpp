#include "tests/support/picture_writers.h"

#include <tiffio.h>
#include <webp/encode.h>
#include <webp/mux.h>

#include <algorithm>
#include <stdexcept>

#include "tests/support/temporary.h"

namespace vsplat::test {
namespace {

std::string little(std::uint32_t value, int bytes) {
  std::string out;
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xff);
  return out;
}

void need(bool done, const std::string& what) {
  if (!done) throw std::runtime_error(what);
}

}  // namespace

void write_test_tiff(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint16_t>& samples, const TiffKind& kind) {
  TIFF* tiff = TIFFOpen(path.c_str(), kind.big_endian ? "wb" : "wl");
  need(tiff, path);
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(width));
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(height));
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, channels);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, kind.depth);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, channels == 1 ? PHOTOMETRIC_MINISBLACK : PHOTOMETRIC_RGB);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, kind.planes ? PLANARCONFIG_SEPARATE : PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, kind.compression);
  TIFFSetField(tiff, TIFFTAG_ORIENTATION, kind.orientation);
  const std::uint16_t extra = kind.associated ? EXTRASAMPLE_ASSOCALPHA : EXTRASAMPLE_UNASSALPHA;
  if (channels == 4) TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &extra);
  constexpr int tile = 16;
  const int block_w = kind.tiled ? tile : width, block_h = kind.tiled ? tile : 4;
  if (kind.tiled) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, tile);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, tile);
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, block_h);
  }
  std::uint32_t block = 0;
  for (int plane = 0; plane < (kind.planes ? channels : 1); ++plane)
    for (int y0 = 0; y0 < height; y0 += block_h)
      for (int x0 = 0; x0 < width; x0 += block_w) {
        std::vector<std::uint8_t> bytes;
        const int rows = kind.tiled ? tile : std::min(block_h, height - y0);
        for (int y = y0; y < y0 + rows; ++y)
          for (int x = x0; x < x0 + block_w; ++x)
            for (int c = kind.planes ? plane : 0; c < (kind.planes ? plane + 1 : channels); ++c) {
              const std::uint16_t v = x < width && y < height ? samples[(y * width + x) * channels + c] : 0;
              bytes.push_back(static_cast<std::uint8_t>(v & 0xff));  // libtiff swaps bytes if necessary
              if (kind.depth == 16) bytes.push_back(static_cast<std::uint8_t>(v >> 8));
            }
        const auto size = static_cast<tmsize_t>(bytes.size());
        need((kind.tiled ? TIFFWriteEncodedTile(tiff, block, bytes.data(), size)
                         : TIFFWriteEncodedStrip(tiff, block, bytes.data(), size)) == size,
             path);
        ++block;
      }
  TIFFClose(tiff);
}

void write_test_webp(const std::string& path, int width, int height, int channels,
                     const std::vector<std::uint8_t>& samples, int quality, const std::string& exif) {
  std::uint8_t* bytes = nullptr;
  const int stride = width * channels;
  const std::size_t size =
      quality == 0    ? (channels == 4 ? WebPEncodeLosslessRGBA(samples.data(), width, height, stride, &bytes)
                                       : WebPEncodeLosslessRGB(samples.data(), width, height, stride, &bytes))
      : channels == 4 ? WebPEncodeRGBA(samples.data(), width, height, stride, static_cast<float>(quality), &bytes)
                      : WebPEncodeRGB(samples.data(), width, height, stride, static_cast<float>(quality), &bytes);
  need(size > 0, path);
  std::string file(reinterpret_cast<char*>(bytes), size);
  WebPFree(bytes);
  if (!exif.empty()) {
    const WebPData picture{reinterpret_cast<const std::uint8_t*>(file.data()), file.size()};
    const WebPData data{reinterpret_cast<const std::uint8_t*>(exif.data()), exif.size()};
    WebPMux* mux = WebPMuxNew();
    WebPData all{};
    need(WebPMuxSetImage(mux, &picture, 1) == WEBP_MUX_OK && WebPMuxSetChunk(mux, "EXIF", &data, 1) == WEBP_MUX_OK &&
             WebPMuxAssemble(mux, &all) == WEBP_MUX_OK,
         path);
    file.assign(reinterpret_cast<const char*>(all.bytes), all.size);
    WebPDataClear(&all);
    WebPMuxDelete(mux);
  }
  put_file(path, file);
}

void write_animated_webp(const std::string& path, int width, int height, int frames) {
  WebPAnimEncoder* encoder = WebPAnimEncoderNew(width, height, nullptr);
  for (int i = 0; i < frames; ++i) {
    WebPPicture picture;
    need(WebPPictureInit(&picture), path);
    picture.width = width, picture.height = height, picture.use_argb = 1;
    need(WebPPictureAlloc(&picture), path);
    std::fill_n(picture.argb, picture.argb_stride * height, 0xff000000u + static_cast<unsigned>(i) * 0x123456u);
    need(WebPAnimEncoderAdd(encoder, &picture, 100 * i, nullptr), path);
    WebPPictureFree(&picture);
  }
  WebPData all{};
  need(WebPAnimEncoderAdd(encoder, nullptr, 100 * frames, nullptr) && WebPAnimEncoderAssemble(encoder, &all), path);
  put_file(path, {reinterpret_cast<const char*>(all.bytes), all.size});
  WebPDataClear(&all);
  WebPAnimEncoderDelete(encoder);
}

void write_test_bmp(const std::string& path, int width, int height, int channels,
                    const std::vector<std::uint8_t>& samples, bool top_down) {
  std::string palette;
  for (std::uint32_t i = 0; channels == 1 && i < 256; ++i) palette += little(i | i << 8 | i << 16, 4);
  const std::uint32_t head = channels == 4 ? 108 : 40;  // with alpha, the fourth version's
  const auto offset = static_cast<std::uint32_t>(14 + head + palette.size());
  const std::uint32_t row = (static_cast<std::uint32_t>(width * channels) + 3) / 4 * 4;
  std::string file = "BM" + little(offset + row * height, 4) + little(0, 4) + little(offset, 4);
  file += little(head, 4) + little(width, 4) + little(static_cast<std::uint32_t>(top_down ? -height : height), 4) +
          little(1, 2) + little(8 * channels, 2) + little(channels == 4 ? 3 : 0, 4) + little(row * height, 4) +
          little(2835, 4) + little(2835, 4) + little(0, 4) + little(0, 4);
  if (channels == 4) {
    for (const std::uint32_t mask : {0xff0000u, 0xff00u, 0xffu, 0xff000000u}) file += little(mask, 4);
    file += little(0x73524742, 4) + std::string(48, '\0');  // sRGB
  }
  file += palette;
  for (int line = 0; line < height; ++line) {
    const int y = top_down ? line : height - 1 - line;
    const std::size_t begin = file.size();
    for (int x = 0; x < width; ++x) {
      const std::uint8_t* p = &samples[static_cast<std::size_t>(y * width + x) * channels];
      if (channels == 1) file += static_cast<char>(p[0]);
      for (int c = 2; channels > 1 && c >= 0; --c) file += static_cast<char>(p[c]);
      if (channels == 4) file += static_cast<char>(p[3]);
    }
    file.resize(begin + row, '\0');
  }
  put_file(path, file);
}

std::string exif_data(int orientation, bool big_endian) {
  const auto number = [&](std::uint32_t value, int bytes) {
    std::string out = little(value, bytes);
    if (big_endian) std::reverse(out.begin(), out.end());
    return out;
  };
  return (big_endian ? "MM" : "II") + number(42, 2) + number(8, 4) + number(1, 2) + number(0x112, 2) + number(3, 2) +
         number(1, 4) + number(static_cast<std::uint32_t>(orientation), 2) + number(0, 2) + number(0, 4);
}

std::string lens_exif_data(const std::string& model, int focal) {
  const std::uint32_t behind_first = 8 + 2 + 2 * 12 + 4, text = static_cast<std::uint32_t>(model.size() + 1),
                      second = behind_first + text + text % 2, behind_second = second + 2 + 12 + 4;
  const auto entry = [](int tag, int type, std::uint32_t count, std::uint32_t value) {
    return little(static_cast<std::uint32_t>(tag), 2) + little(static_cast<std::uint32_t>(type), 2) + little(count, 4) +
           little(value, 4);
  };
  return "II" + little(42, 2) + little(8, 4) + little(2, 2) + entry(0x110, 2, text, behind_first) +
         entry(0x8769, 4, 1, second) + little(0, 4) + model + std::string(1 + text % 2, '\0') + little(1, 2) +
         entry(0x920a, 5, 1, behind_second) + little(0, 4) + little(static_cast<std::uint32_t>(focal), 4) +
         little(1, 4);
}

void add_exif_to_jpeg(const std::string& path, const std::string& exif) {
  const std::string body = std::string("Exif\0\0", 6) + exif;
  std::string file = contents_of(path), length = little(static_cast<std::uint32_t>(body.size() + 2), 2);
  std::reverse(length.begin(), length.end());
  file.insert(2, "\xff\xe1" + length + body);
  put_file(path, file);
}

}  // namespace vsplat::test
