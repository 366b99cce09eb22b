// The patch embedding as the convolution that it is, in double.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// images [v, s, s, 3], weight [c, 3, p, p], bias [c], position [1 + t t, c] -> [v, 1 + t t, c]
inline std::vector<double> patch_embed(const std::vector<float>& images, std::size_t v, std::size_t s, std::size_t p,
                                       const std::vector<float>& weight, const std::vector<float>& bias,
                                       const std::vector<float>& position) {
  const double mean[3] = {0.485, 0.456, 0.406}, deviation[3] = {0.229, 0.224, 0.225};
  const std::size_t c = bias.size(), t = s / p;
  std::vector<double> out;
  for (std::size_t view = 0; view < v; ++view) {
    for (std::size_t n = 0; n < c; ++n) out.push_back(position[n]);
    for (std::size_t py = 0; py < t; ++py) {
      for (std::size_t px = 0; px < t; ++px) {
        for (std::size_t n = 0; n < c; ++n) {
          double sum = bias[n];
          for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t y = 0; y < p; ++y) {
              for (std::size_t x = 0; x < p; ++x) {
                const double pixel = images[((view * s + py * p + y) * s + px * p + x) * 3 + k];
                sum += weight[((n * 3 + k) * p + y) * p + x] * ((pixel - mean[k]) / deviation[k]);
              }
            }
          }
          out.push_back(sum + position[(1 + py * t + px) * c + n]);
        }
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref
