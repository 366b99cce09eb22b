// Programs that are installed with the library and that the library starts.
#pragma once
#include <string>

namespace vsplat {

// The path of such a program, which need not exist; "" if the library's own place is unknown.
std::string library_program(const std::string& name);

}  // namespace vsplat
