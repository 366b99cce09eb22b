// Units in messages.
#pragma once
#include <cstddef>

namespace vsplat {

inline double gib(std::size_t bytes) { return static_cast<double>(bytes) / (1ull << 30); }

}  // namespace vsplat
