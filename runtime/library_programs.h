// Programs that are installed beside the library, and that it starts.
#pragma once
#include <string>

namespace vsplat {

// The path of one of them, whether it is there or not; "" where it is not known where the library lies.
std::string library_program(const std::string& name);

}  // namespace vsplat
