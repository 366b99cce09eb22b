// Tests the network's stages in order on a small model. PyTorch's results for the same weights and pictures are part of
// the library (stages.safetensors: tests/golden/micro.safetensors without its gradients).
#pragma once
#include <cstddef>
#include <span>

#include "model/diagnose/selftest/checks.h"

namespace vsplat::selftest {

Case stages_case();
std::span<const std::byte> stages_file();

}  // namespace vsplat::selftest
