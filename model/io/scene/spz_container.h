// The container of an SPZ file: its header, and the streams of packed values, decompressed. Versions 1 to 3 are one
// gzip stream; version 4 has a plain header, a table of contents and a zstd stream for each group of values.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/system/host_memory.h"

namespace vsplat {

inline constexpr int kSpzOldest = 1, kSpzNewest = 4;
inline constexpr int kSpzMostDegree = 4;
inline constexpr int kSpzMostBits = 24;  // of a position's fraction

// Groups of values, in file order.
enum SpzStream : std::size_t { kSpzPositions, kSpzAlphas, kSpzColors, kSpzScales, kSpzRotations, kSpzSh, kSpzStreams };

struct SpzContainer {
  int version = kSpzNewest;
  std::uint32_t count = 0;
  int degree = 0;
  int bits = 0;  // of a position's fraction
  bool antialias = false;
  // The storage frame as the extension of Adobe numbers it: 4 is right, up, back, which is usual; 6 is right, down,
  // front.
  std::uint32_t frame = 4;
  std::array<std::vector<std::uint8_t>, kSpzStreams> streams;
  HostMemory reserved;  // for the streams that were read, and the floats that are made of them

  std::size_t coefficients() const { return static_cast<std::size_t>((degree + 1) * (degree + 1) - 1); }
  // Bytes of a Gaussian in a stream.
  std::size_t bytes_of(std::size_t stream) const;
};

// What an SPZ file's first bytes say; the version is the file's, even if it is not read. Error(format) for damaged gzip
// data.
struct SpzBeginning {
  std::uint32_t version = 0;
  bool extensions = false;  // there are extension records, which may say where the axes point
};
SpzBeginning spz_beginning(const std::string& name, std::span<const std::byte> content);

// Throws Error(memory), and Error(format) with the path, the field, its byte and what is expected. Allocates at most 64
// MiB, or a thousand times the file's size if that is more.
SpzContainer unpack_spz(const std::string& name, std::span<const std::byte> content);

// The file's bytes; equal streams give equal bytes.
std::string pack_spz(const SpzContainer& spz);

}  // namespace vsplat
