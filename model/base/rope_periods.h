// The periods of the rotation angles that DINOv3 applies to queries and keys.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

namespace vsplat {

// base^(4 i / head) for i = 0 .. head / 4 - 1, optionally rounded to bfloat16 (ties to even), as Meta's files store
// them.
inline std::vector<double> rope_periods(long head, double base, bool bf16) {
  std::vector<double> out;
  for (long i = 0; i < head / 4; ++i) {
    const double period = std::pow(base, 4.0 * static_cast<double>(i) / static_cast<double>(head));
    const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(period));
    const auto rounded = std::bit_cast<float>((bits + 0x7fffu + (bits >> 16 & 1u)) & 0xffff0000u);
    out.push_back(bf16 ? static_cast<double>(rounded) : period);
  }
  return out;
}

}  // namespace vsplat
