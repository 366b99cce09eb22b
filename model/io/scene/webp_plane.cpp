#include "model/io/scene/webp_plane.h"

#include <webp/decode.h>
#include <webp/encode.h>

#include <memory>

#include "runtime/fail.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

// libwebp's level of effort, 0 to 9: higher ones take several times as long for some percent of the size.
constexpr int kWebpEffort = 4;

struct WrittenBytes {
  void operator()(WebPMemoryWriter* writer) const { WebPMemoryWriterClear(writer); }
};

struct UsedPicture {
  void operator()(WebPPicture* picture) const { WebPPictureFree(picture); }
};

}  // namespace

WebpPlane decode_webp_plane(const std::string& what, const std::vector<unsigned char>& bytes, std::size_t least,
                            std::size_t most) {
  WebPBitstreamFeatures features;
  const VP8StatusCode status = WebPGetFeatures(bytes.data(), bytes.size(), &features);
  if (status != VP8_STATUS_OK || features.width <= 0 || features.height <= 0)
    fail(Status::format, "{}: a damaged or cut-off WebP picture ({} bytes)", what, bytes.size());
  if (features.has_animation) fail(Status::format, "{}: an animated WebP; a still one is expected", what);
  WebpPlane out;
  out.width = features.width;
  out.height = features.height;
  if (out.texels() < least || out.texels() > most)
    fail(Status::format, "{}: {} x {} texels; {} to {} texels are expected", what, out.width, out.height, least, most);
  // The texels and libwebp's own copy.
  const HostMemory reserved(what + ": decoding", 8.0 * static_cast<double>(out.texels()));
  out.rgba.resize(4 * out.texels());
  if (!WebPDecodeRGBAInto(bytes.data(), bytes.size(), out.rgba.data(), out.rgba.size(), 4 * out.width))
    fail(Status::format, "{}: a damaged or cut-off WebP picture of {} x {} texels ({} bytes)", what, out.width,
         out.height, bytes.size());
  return out;
}

std::vector<unsigned char> encode_webp_plane(const WebpPlane& plane) {
  WebPConfig config;
  WebPPicture picture;
  if (!WebPConfigInit(&config) || !WebPPictureInit(&picture) || !WebPConfigLosslessPreset(&config, kWebpEffort))
    fail(Status::internal, "libwebp has another version than vsplat was built with");
  config.exact = 1;
  const std::unique_ptr<WebPPicture, UsedPicture> free_picture(&picture);
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  const std::unique_ptr<WebPMemoryWriter, WrittenBytes> free_bytes(&writer);
  picture.use_argb = 1;
  picture.width = plane.width;
  picture.height = plane.height;
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  if (!WebPPictureImportRGBA(&picture, plane.rgba.data(), 4 * plane.width) || !WebPEncode(&config, &picture))
    fail(Status::memory, "a plane of {} x {} texels cannot be encoded (libwebp's error {})", plane.width, plane.height,
         static_cast<int>(picture.error_code));
  return {writer.mem, writer.mem + writer.size};
}

}  // namespace vsplat
