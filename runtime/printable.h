// Text of unknown origin, for a message.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace vsplat {

// At most 100 bytes of it; what a terminal acts upon, what changes how the text about it looks, and what is no UTF-8
// becomes ?.
std::string printable(std::string_view text);

struct Character {
  std::size_t bytes;  // that it takes; 1 where no character of UTF-8 begins there
  char32_t code;
  bool seen;  // it can be shown as it is
};
// The one that the text begins with, which has at least a byte.
Character character_at(std::string_view text);

}  // namespace vsplat
