// A sequence of random numbers for generating data; identical for a seed, element and stream on every machine.
#pragma once
#include <cstdint>

#include "model/base/rng.h"

namespace vsplat {

class Random {
 public:
  Random(std::uint64_t seed, std::uint32_t element, std::uint32_t stream)
      : key_(rng_key(seed)), element_(element), stream_(stream) {}

  double uniform() {  // [0,1)
    if (at_ == 4) {
      block_ = philox4x32_10({element_, step_++, stream_, 0}, key_);
      at_ = 0;
    }
    return uniform01(block_[at_++]);
  }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  int below(int count) { return static_cast<int>(uniform() * count); }  // 0 .. count - 1

 private:
  std::array<std::uint32_t, 2> key_;
  std::array<std::uint32_t, 4> block_{};
  std::uint32_t element_, stream_, step_ = 0;
  int at_ = 4;
};

// Streams, so that no two uses share random numbers.
inline constexpr std::uint32_t camera_stream = 0x63616d73u, solid_stream = 0x736f6c69u, order_stream = 0x6f726472u,
                               draw_stream = 0x64726177u, object_stream = 0x6f626a65u;

}  // namespace vsplat
