#include "runtime/printable.h"

#include <fmt/format.h>

namespace vsplat {
namespace {

// The bytes of the character that begins there; 0 where none does.
std::size_t character_at(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  if (lead < 0x80) return lead >= 0x20 && lead != 0x7f;
  const std::size_t size = lead >= 0xf5 ? 0 : lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : lead >= 0xc2 ? 2 : 0;
  if (size > text.size()) return 0;
  for (std::size_t i = 1; i < size; ++i)
    if (byte(i) >> 6 != 2) return 0;
  // U+0080 to U+009F are control characters, too.
  return lead == 0xc2 && byte(1) < 0xa0 ? 0 : size;
}

}  // namespace

std::string printable(std::string_view text) {
  constexpr std::size_t kLongest = 100;
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t size = character_at(text.substr(at));
    const std::size_t taken = size == 0 ? 1 : size;
    if (at + taken > kLongest) break;
    out += size == 0 ? std::string_view("?") : text.substr(at, size);
    at += taken;
  }
  if (at < text.size()) out += fmt::format("... ({} bytes)", text.size());
  return out;
}

}  // namespace vsplat
