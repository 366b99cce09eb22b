// Programs that are installed with the library and that the library starts.
#pragma once
#include <string>

namespace vsplat {

// The path of such a program, which need not exist; "" if the library's own place is unknown. The library is the one
// with the function at `inside`, or that this is linked into.
std::string library_program(const std::string& name, const void* inside = nullptr);

}  // namespace vsplat
