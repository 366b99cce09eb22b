#include "model/io/picture/exif.h"

#include <libexif/exif-data.h>

#include <cstring>
#include <memory>
#include <vector>

namespace vsplat {

int exif_orientation(const unsigned char* data, std::size_t size) {
  constexpr unsigned char header[] = {'E', 'x', 'i', 'f', 0, 0};
  constexpr std::size_t most = 1 << 20;  // far more than cameras write
  if (size == 0 || size > most) return 1;
  std::vector<unsigned char> block(header, header + sizeof header);
  block.insert(block.end(), data, data + size);
  const std::unique_ptr<ExifData, void (*)(ExifData*)> exif(
      exif_data_new_from_data(block.data(), static_cast<unsigned>(block.size())), exif_data_unref);
  if (!exif) return 1;
  const ExifEntry* entry = exif_content_get_entry(exif->ifd[EXIF_IFD_0], EXIF_TAG_ORIENTATION);
  if (!entry || entry->format != EXIF_FORMAT_SHORT || entry->components < 1 || entry->size < 2) return 1;
  const int value = exif_get_short(entry->data, exif_data_get_byte_order(exif.get()));
  return value >= 1 && value <= 8 ? value : 1;
}

}  // namespace vsplat
