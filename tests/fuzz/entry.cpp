// libFuzzer's entry, for the target VSPLAT_FUZZ_TARGET.
#include <cstddef>
#include <cstdint>

#include "tests/fuzz/targets.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  vsplat::fuzz::VSPLAT_FUZZ_TARGET({reinterpret_cast<const char*>(data), size});
  return 0;
}
