#include "runtime/printable.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>

namespace vsplat {
namespace {

struct Range {
  char32_t first, last;
};

// Invisible characters that change how others look, and so may make a name look like another one: direction marks, line
// separators, joiners, tags (those of Unicode's categories Cc, Cf, Zl and Zp without a glyph). Also surrogates, which
// UTF-8 does not have.
constexpr Range unseen[] = {{0x0000, 0x001f},   {0x007f, 0x009f},   {0x00ad, 0x00ad},  {0x034f, 0x034f},
                            {0x061c, 0x061c},   {0x115f, 0x1160},   {0x17b4, 0x17b5},  {0x180b, 0x180f},
                            {0x200b, 0x200f},   {0x2028, 0x202e},   {0x2060, 0x206f},  {0x3164, 0x3164},
                            {0xd800, 0xdfff},   {0xfeff, 0xfeff},   {0xffa0, 0xffa0},  {0xfff0, 0xfffb},
                            {0x1bca0, 0x1bca3}, {0x1d173, 0x1d17a}, {0xe0000, 0xe0fff}};

bool is_unseen(char32_t c) {
  return std::any_of(std::begin(unseen), std::end(unseen),
                     [c](const Range& range) { return c >= range.first && c <= range.last; });
}

}  // namespace

Character character_at(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  const std::size_t size = lead < 0x80 ? 1 : lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  constexpr char32_t least[] = {0, 0, 0x80, 0x800, 0x10000};
  if (size > text.size() || (lead >= 0x80 && lead < 0xc2) || lead >= 0xf5) return {1, 0, false};
  char32_t code = size == 1 ? lead : lead & (0x7f >> size);
  for (std::size_t i = 1; i < size; ++i) {
    if (byte(i) >> 6 != 2) return {1, 0, false};
    code = code << 6 | (byte(i) & 0x3f);
  }
  if (code < least[size] || code > 0x10ffff) return {1, 0, false};
  return {size, code, !is_unseen(code)};
}

std::string printable(std::string_view text) {
  constexpr std::size_t kLongest = 100;
  std::string out;
  std::size_t at = 0;
  while (at < text.size()) {
    const Character c = character_at(text.substr(at));
    if (at + c.bytes > kLongest) break;
    out += c.seen ? text.substr(at, c.bytes) : std::string_view("?");
    at += c.bytes;
  }
  if (at < text.size()) out += fmt::format("... ({} bytes)", text.size());
  return out;
}

std::string shell_word(std::string_view text) {
  constexpr std::string_view plain = "_-./,:=@%+";  // beside letters and digits
  bool needs_quotes = text.empty();
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const Character c = character_at(text.substr(at));
    const std::string_view shown = c.seen ? text.substr(at, c.bytes) : "?";
    const char first = shown[0];
    needs_quotes = needs_quotes ||
                   !(c.bytes > 1 || std::isalnum(static_cast<unsigned char>(first)) || plain.find(first) != plain.npos);
    out += first == '\'' ? "'\\''" : shown;
    at += c.bytes;
  }
  return needs_quotes ? "'" + out + "'" : out;
}

}  // namespace vsplat
