#include "model/io/picture/exr_header.h"

#include <cstdint>
#include <cstring>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

class Walk {
 public:
  explicit Walk(const FileBytes& file) : file_(file) {}

  std::uint32_t number() {
    need(4);
    std::uint32_t out = 0;
    std::memcpy(&out, file_.data + at_, 4);  // little-endian, like the host
    at_ += 4;
    return out;
  }

  // Reads up to and including a zero byte; returns "" at the end of a header.
  std::string_view text() {
    constexpr std::size_t kLongest = 255;
    const auto* begin = reinterpret_cast<const char*>(file_.data) + at_;
    const std::size_t length = ::strnlen(begin, file_.size - at_);
    need(length + 1);
    if (length > kLongest)
      fail(Status::format, "{}: a damaged EXR: a name of {} bytes in its header, at most {} are expected", file_.path,
           length, kLongest);
    at_ += length + 1;
    return {begin, length};
  }

  // Skips a value of `size` bytes. OpenEXR reads some types by their own size instead and would then continue at
  // another position.
  void value(std::string_view name, std::string_view type, std::uint32_t size) {
    if (size > file_.size - at_)
      fail(Status::format, "{}: a damaged or cut-off EXR: its header's {} claims {} bytes, {} follow", file_.path,
           printable(name), size, file_.size - at_);
    const std::size_t end = at_ + size;
    if (type == "chlist") channels();
    if (type == "preview") preview(size);
    for (const auto& [known, bytes] : kFixed)
      if (type == known) at_ += bytes;
    const bool fixed = type == "chlist" || type == "preview" || at_ > end - size;
    if (fixed && at_ != end)
      fail(Status::format, "{}: a damaged EXR: its header's {} of type {} claims {} bytes", file_.path, printable(name),
           type, size);
    at_ = end;
  }

 private:
  struct Fixed {
    std::string_view type;
    std::size_t bytes;
  };
  static constexpr Fixed kFixed[] = {{"box2f", 16},
                                     {"box2i", 16},
                                     {"chromaticities", 32},
                                     {"compression", 1},
                                     {"deepImageState", 1},
                                     {"double", 8},
                                     {"envmap", 1},
                                     {"float", 4},
                                     {"int", 4},
                                     {"keycode", 28},
                                     {"lineOrder", 1},
                                     {"m33d", 72},
                                     {"m33f", 36},
                                     {"m44d", 128},
                                     {"m44f", 64},
                                     {"rational", 8},
                                     {"tiledesc", 9},
                                     {"timecode", 8},
                                     {"v2d", 16},
                                     {"v2f", 8},
                                     {"v2i", 8},
                                     {"v3d", 24},
                                     {"v3f", 12},
                                     {"v3i", 12}};

  // Ends at an empty name, wherever that is.
  void channels() {
    constexpr std::size_t kEach = 16;
    while (!text().empty()) {
      need(kEach);
      at_ += kEach;
    }
  }

  void preview(std::uint32_t size) {
    if (size < 8) return;
    const std::uint64_t width = number(), height = number();
    if (width * height <= size / 4) at_ += 4 * width * height;
  }

  void need(std::size_t bytes) const {
    if (bytes > file_.size - at_)
      fail(Status::format, "{}: a damaged or cut-off EXR: it ends in its header", file_.path);
  }

  const FileBytes& file_;
  std::size_t at_ = 0;
};

}  // namespace

void check_exr_header(const FileBytes& file) {
  constexpr std::uint32_t kSeveralParts = 0x1000;
  Walk walk(file);
  walk.number();  // the magic number
  const bool parts = (walk.number() & kSeveralParts) != 0;
  for (bool more = true; more;) {
    more = false;
    for (std::string_view name = walk.text(); !name.empty(); name = walk.text()) {
      more = parts;  // an empty header ends the list of parts
      const std::string_view type = walk.text();
      walk.value(name, type, walk.number());
    }
  }
}

}  // namespace vsplat
