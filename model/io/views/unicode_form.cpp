#include "model/io/views/unicode_form.h"

#include "runtime/printable.h"

namespace vsplat {
namespace {

// What follows the letter that it belongs to: accents, the voicing of kana, and the vowels and finals of Hangul.
bool is_mark(char32_t c) {
  return (c >= 0x300 && c <= 0x36f) || (c >= 0x3099 && c <= 0x309a) || (c >= 0x1161 && c <= 0x11ff);
}

// A letter with its marks.
struct Letter {
  std::string_view bytes;
  char32_t first;
  int marks = 0;
};

// Removes it from the start of the text, which must not be empty.
Letter take_letter(std::string_view& text) {
  const Character first = character_at(text);
  Letter out{{}, first.code};
  std::size_t size = first.bytes;
  while (size < text.size()) {
    const Character next = character_at(text.substr(size));
    if (!is_mark(next.code)) break;
    size += next.bytes, ++out.marks;
  }
  out.bytes = text.substr(0, size);
  text.remove_prefix(size);
  return out;
}

}  // namespace

bool may_differ_in_form_only(std::string_view a, std::string_view b) {
  bool differ = false;
  while (!a.empty() && !b.empty()) {
    const Letter one = take_letter(a), other = take_letter(b);
    if (one.bytes == other.bytes) continue;
    if (one.marks == other.marks) return false;
    constexpr char32_t first_composed = 0xc0;
    if ((one.marks < other.marks ? one : other).first < first_composed) return false;
    differ = true;
  }
  return differ && a.empty() && b.empty();
}

}  // namespace vsplat
