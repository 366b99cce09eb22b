#include <algorithm>

#include "model/io/picture/image_file.h"
#include "model/io/picture/image_formats.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {

namespace {

using Is = bool (*)(const FileBytes&);

// Fuzzes a single format, so that each format gets the same time.
void picture(Is is, std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  if (!is({file.path(), reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()})) return;
  try {
    const ImageInfo info = read_image_info(file.path());
    hold(info.width >= 1 && info.height >= 1 && info.orientation >= 1 && info.orientation <= 8, "what the header says");
    if (static_cast<long>(info.width) * info.height > 1 << 20) return;  // possible, and slow
    const Image image = read_image(file.path());
    hold(image.width == info.width && image.height == info.height && image.channels == (info.alpha ? 4 : 3), "sizes");
    hold(image.data.size() == static_cast<std::size_t>(image.width) * image.height * image.channels, "sizes");
    hold(std::all_of(image.data.begin(), image.data.end(), [](float v) { return v >= 0 && v <= 1; }), "from 0 to 1");
    const Image shown = ImageFile(file.path()).decode(info.orientation);
    hold(shown.width * shown.height == image.width * image.height, "turning keeps the pixels");
  } catch (const Error& e) {
    hold_message(e, file.path());
  }
}

}  // namespace

void picture_bmp(std::string_view bytes) { picture(is_bmp, bytes); }
void picture_exr(std::string_view bytes) { picture(is_exr, bytes); }
void picture_jpeg(std::string_view bytes) { picture(is_jpeg, bytes); }
void picture_png(std::string_view bytes) { picture(is_png, bytes); }
void picture_tiff(std::string_view bytes) { picture(is_tiff, bytes); }
void picture_webp(std::string_view bytes) { picture(is_webp, bytes); }

}  // namespace vsplat::fuzz
