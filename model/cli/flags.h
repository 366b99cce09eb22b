// The library's messages name the fields and functions of its interface; here these become the command's options.
#pragma once
#include <string>

namespace command {

// Returns `text` with each field of an options struct (vsplat_input_options.force) and each function
// (vsplat_views_load) replaced by the option of this command that stands for it (--force, --pictures). Other names
// stay.
std::string with_flags(const std::string& text);

}  // namespace command
