// The library's messages name the fields and functions that its callers have; here they become the command's options.
#pragma once
#include <string>

namespace command {

// `text` with each field of an options struct (vsplat_input_options.force) and each function (vsplat_views_load) that
// an option of this command stands for replaced by that option (--force, --pictures). Names that no option stands for
// stay.
std::string with_flags(const std::string& text);

}  // namespace command
