// The exclusive prefix sum, written out.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat::ref {

inline std::vector<std::uint32_t> exclusive_scan(const std::vector<std::uint32_t>& in) {
  std::vector<std::uint32_t> out(in.size() + 1, 0);
  for (std::size_t i = 0; i < in.size(); ++i) out[i + 1] = out[i] + in[i];
  return out;
}

}  // namespace vsplat::ref
