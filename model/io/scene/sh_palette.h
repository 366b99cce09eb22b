// A palette of vectors of spherical harmonics, of which each Gaussian gets one that is near its own.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace vsplat {

struct ShPalette {
  std::size_t width = 0;              // numbers of a vector
  std::vector<float> centroids;       // [size][width]
  std::vector<std::uint16_t> labels;  // [count], below the size

  std::size_t size() const { return width ? centroids.size() / width : 0; }
};

// How many vectors other writers of this format use for `count` Gaussians: a power of two times 1024, at most 65536.
// Never more than `count`.
std::size_t sh_palette_size(std::size_t count);

// Divides the vectors [count][width] by planes until a part has few centroids left, and finds these by k-means. Has at
// most `size` (up to 65536) centroids. The result depends on the vectors alone, not on the number of threads.
ShPalette make_sh_palette(std::vector<float> vectors, std::size_t width, std::size_t size);

}  // namespace vsplat
