// The same network in PyTorch, by bench/pytorch_forward.py, if python3 has PyTorch.
#pragma once
#include <map>
#include <string>

#include "runtime/context.h"

namespace vsplat::bench {

// Median seconds of a forward of this size on the processor, with as many threads as the device has cores: in fp32 and
// with autocast to bf16, by names with PyTorch's version. Empty, with a message that says why, if it cannot run here or
// the device is not a processor.
std::map<std::string, double> pytorch_seconds(const Context& ctx, const std::string& size, double seconds);

}  // namespace vsplat::bench
