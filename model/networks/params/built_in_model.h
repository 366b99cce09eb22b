// The model inside the library, which can therefore reconstruct without any other file: the bytes of a model file,
// chosen at build time (VSPLAT_MODEL in model/CMakeLists.txt).
#pragma once
#include <span>

#include "runtime/files/safetensors.h"

namespace vsplat {

// Valid until the program ends. Empty if the library was built without a model.
std::span<const std::byte> built_in_model();

// Opens it for load_model() and similar functions; Error(file) if there is none.
SafetensorsFile open_built_in_model();

}  // namespace vsplat
