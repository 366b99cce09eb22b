#include "model/io/picture/exif.h"

#include <libexif/exif-data.h>

#include <cstring>
#include <memory>
#include <utility>
#include <vector>

namespace vsplat {
namespace {

int orientation_in(const ExifData& exif) {
  const ExifEntry* entry = exif_content_get_entry(exif.ifd[EXIF_IFD_0], EXIF_TAG_ORIENTATION);
  if (!entry || entry->format != EXIF_FORMAT_SHORT || entry->components < 1 || entry->size < 2) return 1;
  const int value = exif_get_short(entry->data, exif_data_get_byte_order(const_cast<ExifData*>(&exif)));
  return value >= 1 && value <= 8 ? value : 1;
}

std::string lens_in(const ExifData& exif) {
  constexpr auto lens_model = static_cast<ExifTag>(0xa434);  // older versions of libexif have no name for it
  constexpr std::pair<ExifIfd, ExifTag> stated[] = {{EXIF_IFD_0, EXIF_TAG_MAKE},
                                                    {EXIF_IFD_0, EXIF_TAG_MODEL},
                                                    {EXIF_IFD_EXIF, lens_model},
                                                    {EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH},
                                                    {EXIF_IFD_EXIF, EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM}};
  std::string out;
  for (const auto& [part, tag] : stated) {
    ExifEntry* entry = exif_content_get_entry(exif.ifd[part], tag);
    char text[256] = "";
    if (!entry || !exif_entry_get_value(entry, text, sizeof text)) continue;
    std::string value = text;
    value.erase(value.find_last_not_of(' ') + 1);
    if (!value.empty()) out += (out.empty() ? "" : ", ") + value;
  }
  return out;
}

}  // namespace

ExifFacts read_exif(const unsigned char* data, std::size_t size) {
  constexpr unsigned char header[] = {'E', 'x', 'i', 'f', 0, 0};
  constexpr std::size_t most = 1 << 20;  // far more than cameras write
  if (size == 0 || size > most) return {};
  std::vector<unsigned char> block(header, header + sizeof header);
  block.insert(block.end(), data, data + size);
  const std::unique_ptr<ExifData, void (*)(ExifData*)> exif(
      exif_data_new_from_data(block.data(), static_cast<unsigned>(block.size())), exif_data_unref);
  if (!exif) return {};
  return {orientation_in(*exif), lens_in(*exif)};
}

}  // namespace vsplat
