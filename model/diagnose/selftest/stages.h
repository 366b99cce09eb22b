// The network's stages, one after the other, of a small model: what PyTorch makes of the same weights and pictures is
// part of the library (stages.safetensors: tests/golden/micro.safetensors without its gradients).
#pragma once
#include <cstddef>
#include <span>

#include "model/diagnose/selftest/checks.h"

namespace vsplat::selftest {

Case stages_case();
std::span<const std::byte> stages_file();

}  // namespace vsplat::selftest
