// Codebooks of numbers: 256 values, of which each number gets the nearest.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

namespace vsplat {

class Codebook {
 public:
  // The least sum of squared errors that 256 values can have, up to the width of 8192 bins. Exact if there are at most
  // 256 different numbers. The numbers are finite, and at least one.
  explicit Codebook(std::vector<float> numbers);

  // Ascending; the last one is repeated where fewer are needed.
  const std::array<float, 256>& values() const { return values_; }
  // The index of the nearest value.
  std::uint8_t nearest(float number) const;

 private:
  std::array<float, 256> values_{};
};

}  // namespace vsplat
