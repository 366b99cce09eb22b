#include "model/io/picture/animation.h"
#include "runtime/fail.h"
#ifdef VSPLAT_GIF
#include <gif_lib.h>

#include "model/io/picture/palette.h"
#endif

namespace vsplat {
#ifdef VSPLAT_GIF
namespace {

constexpr double most_fps = 50;  // players show a picture with a shorter time for 0.1 s

class GifAnimation : public AnimationFile {
 public:
  explicit GifAnimation(const AnimationOptions& options) : AnimationFile(options) {
    if (options.fps > most_fps)
      fail(Status::usage, "a GIF of {} pictures a second; at most {} are possible", options.fps, most_fps);
    int error = 0;
    file_ = EGifOpen(&written_, append, &error);
    if (!file_) fail(Status::memory, "not enough memory to encode an animation");
    EGifSetGifVersion(file_, true);
  }
  ~GifAnimation() override { close(); }
  GifAnimation(const GifAnimation&) = delete;
  GifAnimation& operator=(const GifAnimation&) = delete;

 private:
  static int append(GifFileType* file, const GifByteType* bytes, int count) {
    auto& to = *static_cast<std::vector<unsigned char>*>(file->UserData);
    try {
      to.insert(to.end(), bytes, bytes + count);
    } catch (const std::bad_alloc&) {
      return 0;  // no exception may pass through the library
    }
    return count;
  }

  int close() {
    const int out = file_ ? EGifCloseFile(file_, nullptr) : GIF_OK;
    file_ = nullptr;
    return out;
  }

  static void check(int good) {
    if (good != GIF_OK) fail(Status::internal, "GIF encoding failed");
  }

  void begin() {
    constexpr unsigned char for_ever[] = {1, 0, 0};
    check(EGifPutScreenDesc(file_, width(), height(), 8, 0, nullptr));
    check(EGifPutExtensionLeader(file_, APPLICATION_EXT_FUNC_CODE));
    check(EGifPutExtensionBlock(file_, 11, "NETSCAPE2.0"));
    check(EGifPutExtensionBlock(file_, sizeof for_ever, for_ever));
    check(EGifPutExtensionTrailer(file_));
  }

  void encode(const std::vector<unsigned char>& rgb, int index) override {
    if (index == 0) begin();
    std::vector<IndexedPicture::Colour> pixels(rgb.size() / 3);
    for (std::size_t i = 0; i < rgb.size(); ++i) pixels[i / 3][i % 3] = rgb[i];
    IndexedPicture picture = indexed(pixels, width());
    const int colours = 1 << GifBitSize(static_cast<int>(picture.palette.size()));
    const std::unique_ptr<ColorMapObject, void (*)(ColorMapObject*)> map(GifMakeMapObject(colours, nullptr),
                                                                         GifFreeMapObject);
    if (!map) fail(Status::memory, "not enough memory to encode an animation");
    for (std::size_t i = 0; i < picture.palette.size(); ++i)
      map->Colors[i] = {picture.palette[i][0], picture.palette[i][1], picture.palette[i][2]};
    const GraphicsControlBlock control{DISPOSE_DO_NOT, false, time_of(index + 1, 100) - time_of(index, 100),
                                       NO_TRANSPARENT_COLOR};
    GifByteType extension[4];
    EGifGCBToExtension(&control, extension);
    check(EGifPutExtension(file_, GRAPHICS_EXT_FUNC_CODE, sizeof extension, extension));
    check(EGifPutImageDesc(file_, 0, 0, width(), height(), false, map.get()));
    for (int y = 0; y < height(); ++y)
      check(EGifPutLine(file_, &picture.pixels[static_cast<std::size_t>(y) * width()], width()));
  }

  std::vector<unsigned char> finish() override {
    check(close());
    return std::move(written_);
  }

  std::vector<unsigned char> written_;
  GifFileType* file_ = nullptr;
};

}  // namespace

std::unique_ptr<AnimationFile> gif_animation(const AnimationOptions& options) {
  return std::make_unique<GifAnimation>(options);
}
#else
std::unique_ptr<AnimationFile> gif_animation(const AnimationOptions&) {
  fail(Status::usage, "GIF was left out of this build, for want of giflib (Debian: libgif-dev); WebP is there");
}
#endif
}  // namespace vsplat
