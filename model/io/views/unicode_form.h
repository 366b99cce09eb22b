// Names that are the same text in different bytes: Unicode writes "ä" as one character (composed, as most systems do)
// or as an "a" and a combining mark (decomposed, as macOS does).
#pragma once
#include <string>
#include <string_view>

namespace vsplat {

bool is_ascii(std::string_view text);

// The text with its characters composed (Unicode's form NFC). Text that is not valid UTF-8 is returned unchanged.
std::string composed(std::string_view text);

// Composed, and the same for texts that differ in case only. In text that is not valid UTF-8, only ASCII letters
// change.
std::string folded(std::string_view text);

}  // namespace vsplat
