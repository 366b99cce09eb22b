// The model that the library carries, so that it reconstructs without any file beside it: a model file's bytes, chosen
// when it was built (VSPLAT_MODEL in model/CMakeLists.txt).
#pragma once
#include <span>

#include "runtime/files/safetensors.h"

namespace vsplat {

// Lives as long as the program. Empty where the library was built without a model.
std::span<const std::byte> built_in_model();

// Opened for load_model() and its like; Error(file) where there is none.
SafetensorsFile open_built_in_model();

}  // namespace vsplat
