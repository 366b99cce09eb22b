// Makes text of unknown origin safe to print in a message.
#pragma once
#include <cstddef>
#include <string>
#include <string_view>

namespace vsplat {

// Returns at most 100 bytes of `text`. Terminal control characters, characters that change how the text around them
// looks, and invalid UTF-8 become "?".
std::string printable(std::string_view text);

// Returns all of `text` as one word of a shell command that the user may copy: in single quotes if it needs them. What
// printable() replaces becomes "?".
std::string shell_word(std::string_view text);

struct Character {
  std::size_t bytes;  // length; 1 if no valid UTF-8 character begins there
  char32_t code;
  bool seen;  // it can be printed as it is
};
// The first character of `text`, which must not be empty.
Character character_at(std::string_view text);

}  // namespace vsplat
