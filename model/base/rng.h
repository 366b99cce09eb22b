// Counter-based random numbers, the host version of cl/rng.clh: Philox4x32-10 (Salmon et al., SC 2011). A number only
// depends on its counter and key, not on the order of work or the device. By convention the counter is {element, step,
// stream, 0} and the key the two halves of the seed.
#pragma once
#include <array>
#include <cstdint>
#include <string_view>

namespace vsplat {

inline std::array<std::uint32_t, 4> philox4x32_10(std::array<std::uint32_t, 4> counter,
                                                  std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t a = std::uint64_t{0xD2511F53u} * counter[0];
    const std::uint64_t b = std::uint64_t{0xCD9E8D57u} * counter[2];
    counter = {static_cast<std::uint32_t>(b >> 32) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(b),
               static_cast<std::uint32_t>(a >> 32) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(a)};
    key[0] += 0x9E3779B9u;
    key[1] += 0xBB67AE85u;
  }
  return counter;
}

inline std::array<std::uint32_t, 2> rng_key(std::uint64_t seed) {
  return {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)};
}

// The random stream of a name (FNV-1a, 32 bits), which makes its numbers independent of other streams.
inline std::uint32_t stream_of(std::string_view name) {
  std::uint32_t hash = 2166136261u;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 16777619u;
  return hash;
}

// In [0, 1), a multiple of 2^-24.
inline float uniform01(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24f; }
// In (0, 1) without both ends: an odd multiple of 2^-24, so that log(u) and log(1 - u) are finite.
inline float uniform_open(std::uint32_t bits) { return (static_cast<float>(bits >> 9) + 0.5f) * 0x1p-23f; }

}  // namespace vsplat
