// Names that look the same and are different bytes: Unicode writes "ä" as one character (composed, as most systems do)
// or as an "a" and a combining mark (decomposed, as macOS does).
#pragma once
#include <string_view>

namespace vsplat {

// Whether the texts differ, and may do so only in their Unicode form. Has none of Unicode's tables: a letter with marks
// may be any composed letter. That is enough for advice, and too little to choose a file by.
bool may_differ_in_form_only(std::string_view a, std::string_view b);

}  // namespace vsplat
