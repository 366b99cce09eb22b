// The host's clock, for measurements.
#pragma once
#include <chrono>
#include <cstdint>

namespace vsplat {

inline std::uint64_t now_ns() {
  const auto since = std::chrono::steady_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(since).count());
}

}  // namespace vsplat
