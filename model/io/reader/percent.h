// Names in URIs, as glTF and lists of pictures have them.
#pragma once
#include <charconv>
#include <string>
#include <string_view>

namespace vsplat {

// Replaces %20 and the like by the bytes that they stand for.
inline std::string percent_decoded(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned char byte = 0;
    const char* const digits = text.data() + i + 1;
    const bool coded =
        text[i] == '%' && i + 2 < text.size() && std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2;
    out += coded ? static_cast<char>(byte) : text[i];
    if (coded) i += 2;
  }
  return out;
}

}  // namespace vsplat
