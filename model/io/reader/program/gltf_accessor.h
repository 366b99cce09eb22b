// Reads the numbers of a glTF file's accessors.
#pragma once
#include <cstdint>
#include <vector>

#include "model/io/reader/program/gltf_file.h"

namespace vsplat::read {

// `width` numbers for each of `count` elements, element by element.
struct Numbers {
  std::size_t count = 0, width = 0;
  std::vector<float> values;

  const float* at(std::size_t i) const { return &values[i * width]; }
};

// The accessor that `number` refers to, as floats: normalised integers become fractions, other integers keep their
// value, sparse values are filled in. Its elements must have one of the `widths`.
Numbers read_numbers(GltfFile& file, const Field& number, const std::vector<std::size_t>& widths);
// The factor that the component type and `normalized` imply for values decoded elsewhere.
float accessor_scale(const Field& accessor);
std::size_t accessor_width(const Field& accessor);

// Integers: indices (width 1) or joints (width 4).
std::vector<std::uint32_t> read_wholes(GltfFile& file, const Field& number, std::size_t width);

}  // namespace vsplat::read
