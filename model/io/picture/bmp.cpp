#include <climits>
#include <cstdint>
#include <cstdlib>
#include <memory>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#define STBI_NO_STDIO
#define STBI_ONLY_BMP
#include <stb/stb_image.h>

#include "model/io/picture/image_formats.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr std::size_t headers = 26;  // the file header and the shortest picture header that has a size

std::uint32_t u32(const FileBytes& file, std::size_t at) {
  return file.data[at] | file.data[at + 1] << 8 | file.data[at + 2] << 16 |
         static_cast<std::uint32_t>(file.data[at + 3]) << 24;
}
std::uint32_t u16(const FileBytes& file, std::size_t at) { return file.data[at] | file.data[at + 1] << 8; }

[[noreturn]] void damaged(const FileBytes& file, const char* why) {
  fail(Status::format, "{}: a damaged or cut-off BMP, or one of a kind that is not read (RLE): {}", file.path, why);
}

// stb_image replaces missing data at the end by zeros, so the size is checked against the header here.
void check_length(const FileBytes& file, int width, int height) {
  const bool old = u32(file, 14) == 12;
  if (!old && file.size < 34) damaged(file, "the file ends early");
  const std::uint64_t bits = old ? u16(file, 24) : u16(file, 28);
  const std::uint64_t row = (bits * static_cast<std::uint64_t>(width) + 31) / 32 * 4;
  if (u32(file, 10) + row * static_cast<std::uint64_t>(height) > file.size) damaged(file, "the file ends early");
}

struct Header {
  int width = 0, height = 0, channels = 0;
};

Header header_of(const FileBytes& file) {
  Header h;
  if (file.size < headers || file.size > INT_MAX) damaged(file, "its size");
  if (!stbi_info_from_memory(file.data, static_cast<int>(file.size), &h.width, &h.height, &h.channels))
    damaged(file, stbi_failure_reason());
  h.height = std::abs(h.height);  // negative if the rows are stored from top to bottom
  check_image_size(file.path, h.width, h.height);
  return h;
}

ImageInfo info_of(const Header& h) {
  const bool alpha = h.channels == 4;
  return {h.width, h.height, alpha, 1, static_cast<double>(h.width) * h.height * (alpha ? 4 : 3)};
}

class BmpRows : public FileRows {
 public:
  BmpRows(const FileBytes& file, Header h) : FileRows(info_of(h), 8), pixels_(nullptr, stbi_image_free) {
    check_length(file, h.width, h.height);
    held_ = memory_to_decode(file, info_of(h));
    pixels_.reset(
        stbi_load_from_memory(file.data, static_cast<int>(file.size), &h.width, &h.height, &h.channels, channels));
    if (!pixels_) damaged(file, stbi_failure_reason());
    from_ = pixels_.get();
  }

  void next(float* row) override {
    for (std::size_t i = 0; i < row_size(); ++i) row[i] = static_cast<float>(*from_++) / 255.0f;
  }

 private:
  DecodingMemory held_;
  std::unique_ptr<unsigned char, void (*)(void*)> pixels_;
  const unsigned char* from_ = nullptr;
};

}  // namespace

bool is_bmp(const FileBytes& file) { return file.size >= 2 && file.data[0] == 'B' && file.data[1] == 'M'; }

ImageInfo bmp_info(const FileBytes& file) { return info_of(header_of(file)); }

std::unique_ptr<FileRows> open_bmp(const FileBytes& file) { return std::make_unique<BmpRows>(file, header_of(file)); }

}  // namespace vsplat
