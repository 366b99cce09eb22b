// The meta.json of a SOG file.
#pragma once
#include <array>
#include <cstddef>
#include <span>
#include <string>

#include "model/base/scene.h"

namespace vsplat {

// What the bytes 0 to 255 of a plane's channel mean.
using SogTable = std::array<float, 256>;

struct SogMeta {
  std::size_t count = 0;
  std::array<double, 3> mins{}, maxs{};  // of positions after the logarithm
  std::array<SogTable, 3> scales{};      // natural logarithms
  std::array<SogTable, 3> colours{};     // coefficients of degree 0
  SogTable opacities{};                  // 0 to 1
  std::string means_low, means_high, scales_file, quats_file, sh0_file;

  bool has_sh = false;
  std::size_t palette = 0;  // vectors; 0: as many as its plane holds (version 1)
  int degree = 0;           // 1 to 3; 0: by the width of its plane (version 1)
  SogTable sh{};
  std::string centroids_file, labels_file;

  Scene scene;  // without Gaussians
};

// `what` begins messages. Error(format) for invalid JSON, an unknown version and fields of another type, and for names
// of files that are not plain. An entry of a codebook that is null is NaN.
SogMeta parse_sog_meta(const std::string& what, const std::string& text);

}  // namespace vsplat
