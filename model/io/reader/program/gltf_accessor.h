// The numbers that a glTF file's accessors give.
#pragma once
#include <cstdint>
#include <vector>

#include "model/io/reader/program/gltf_file.h"

namespace vsplat::read {

// `width` numbers for each of `count` elements, one after the other.
struct Numbers {
  std::size_t count = 0, width = 0;
  std::vector<float> values;

  const float* at(std::size_t i) const { return &values[i * width]; }
};

// The accessor that `number` names, as floats: normalised integers become fractions, other integers stay what they
// are, what is sparse is filled in. Its elements have as many numbers as `widths` allows.
Numbers read_numbers(GltfFile& file, const Field& number, const std::vector<std::size_t>& widths);
// What its components' type and `normalized` make of values that were decoded elsewhere.
float accessor_scale(const Field& accessor);
std::size_t accessor_width(const Field& accessor);

// Whole numbers: indices and joints. One or four to an element.
std::vector<std::uint32_t> read_wholes(GltfFile& file, const Field& number, std::size_t width);

}  // namespace vsplat::read
