#include <webp/decode.h>
#include <webp/mux.h>

#include <cstring>
#include <memory>

#include "model/io/picture/exif.h"
#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

const char* name_of(VP8StatusCode status) {
  switch (status) {
    case VP8_STATUS_NOT_ENOUGH_DATA:
      return "the file ends early";
    case VP8_STATUS_OUT_OF_MEMORY:  // also for some damage, since libwebp 1.3
      return "its data are damaged, or memory was not enough";
    case VP8_STATUS_UNSUPPORTED_FEATURE:
      return "it has a feature that libwebp does not know";
    default:
      return "its data are damaged";
  }
}

[[noreturn]] void damaged(const FileBytes& file, VP8StatusCode status) {
  fail(Status::format, "{}: a damaged or cut-off WebP: {}", file.path, name_of(status));
}

WebPBitstreamFeatures features_of(const FileBytes& file) {
  WebPBitstreamFeatures out;
  const VP8StatusCode status = WebPGetFeatures(file.data, file.size, &out);
  if (status != VP8_STATUS_OK) damaged(file, status);
  check_image_size(file.path, out.width, out.height);
  if (out.has_animation) fail(Status::format, "{}: an animated WebP; only still ones are read", file.path);
  return out;
}

// What the EXIF chunk states, which follows the picture. Error(format) if the header announces a chunk that is not
// in these bytes.
ExifFacts exif_of(const FileBytes& file) {
  constexpr std::size_t extended_header = 30;  // RIFF header, VP8X chunk
  constexpr unsigned char exif_flag = 0x08;
  if (file.size < extended_header || std::memcmp(file.data + 12, "VP8X", 4) != 0 || !(file.data[20] & exif_flag))
    return {};
  const WebPData all{file.data, file.size};
  const std::unique_ptr<WebPMux, void (*)(WebPMux*)> chunks(WebPMuxCreate(&all, 0), WebPMuxDelete);
  WebPData exif;
  if (!chunks || WebPMuxGetChunk(chunks.get(), "EXIF", &exif) != WEBP_MUX_OK) damaged(file, VP8_STATUS_NOT_ENOUGH_DATA);
  // Some writers put JPEG's "Exif\0\0" before it.
  const std::size_t skipped = exif.size > 6 && std::memcmp(exif.bytes, "Exif\0\0", 6) == 0 ? 6 : 0;
  return read_exif(exif.bytes + skipped, exif.size - skipped);
}

// libwebp decodes a picture as a whole. This counts its bytes and the transformed copy that lossless files need.
ImageInfo info_of(const WebPBitstreamFeatures& f, const ExifFacts& exif = {}) {
  const bool alpha = f.has_alpha != 0;
  return {f.width,  f.height, alpha, exif.orientation, static_cast<double>(f.width) * f.height * (alpha ? 8 : 7),
          exif.lens};
}

class WebpRows : public FileRows {
 public:
  WebpRows(const FileBytes& file, const WebPBitstreamFeatures& features)
      : FileRows(info_of(features), 8), held_(memory_to_decode(file, info_of(features))) {
    if (!WebPInitDecoderConfig(&config_)) fail(Status::internal, "libwebp is of another version than its header");
    config_.output.colorspace = features.has_alpha ? MODE_RGBA : MODE_RGB;
    const VP8StatusCode status = WebPDecode(file.data, file.size, &config_);
    if (status != VP8_STATUS_OK) {
      WebPFreeDecBuffer(&config_.output);
      damaged(file, status);
    }
  }
  ~WebpRows() override { WebPFreeDecBuffer(&config_.output); }

  void next(float* row) override {
    const WebPRGBABuffer& buffer = config_.output.u.RGBA;
    const unsigned char* from = buffer.rgba + static_cast<std::size_t>(at_++) * buffer.stride;
    for (std::size_t i = 0; i < row_size(); ++i) row[i] = static_cast<float>(from[i]) / 255.0f;
  }

 private:
  DecodingMemory held_;
  WebPDecoderConfig config_;
  int at_ = 0;
};

}  // namespace

bool is_webp(const FileBytes& file) {
  return file.size >= 12 && std::memcmp(file.data, "RIFF", 4) == 0 && std::memcmp(file.data + 8, "WEBP", 4) == 0;
}

ImageInfo webp_info(const FileBytes& file) {
  const WebPBitstreamFeatures features = features_of(file);
  return info_of(features, exif_of(file));
}

std::unique_ptr<FileRows> open_webp(const FileBytes& file) {
  const WebPBitstreamFeatures features = features_of(file);
  // Checks the file's own length, because libwebp only reads up to the end of the picture data.
  const std::size_t stated =
      8 + (file.data[4] | file.data[5] << 8 | file.data[6] << 16 | static_cast<std::size_t>(file.data[7]) << 24);
  if (stated > file.size) damaged(file, VP8_STATUS_NOT_ENOUGH_DATA);
  return std::make_unique<WebpRows>(file, features);
}

}  // namespace vsplat
