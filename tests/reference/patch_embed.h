// The patch embedding as the convolution that it is, in double.
#pragma once
#include <cstddef>
#include <vector>

namespace vsplat::ref {

// Their normalisation: ImageNet's.
inline double normalised(double pixel, std::size_t channel) {
  const double mean[3] = {0.485, 0.456, 0.406}, deviation[3] = {0.229, 0.224, 0.225};
  return (pixel - mean[channel]) / deviation[channel];
}

// images [v, s, s, 3], weight [c, 3, p, p], bias [c], position [1 + t t, c] -> [v, 1 + t t, c]
template <class F>
std::vector<double> patch_embed(const std::vector<float>& images, std::size_t v, std::size_t s, std::size_t p,
                                const std::vector<F>& weight, const std::vector<F>& bias,
                                const std::vector<F>& position) {
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
                sum += weight[((n * 3 + k) * p + y) * p + x] * normalised(pixel, k);
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

struct PatchEmbedGradients {
  std::vector<double> weight;    // [c, 3, p, p]
  std::vector<double> bias;      // [c]
  std::vector<double> position;  // [1 + t t, c]
};

// Of sum(dtokens * patch_embed(...)).
inline PatchEmbedGradients patch_embed_backward(const std::vector<float>& images, std::size_t v, std::size_t s,
                                                std::size_t p, std::size_t c, const std::vector<double>& dtokens) {
  const std::size_t t = s / p, tokens = 1 + t * t;
  PatchEmbedGradients out{std::vector<double>(c * 3 * p * p), std::vector<double>(c), std::vector<double>(tokens * c)};
  for (std::size_t view = 0; view < v; ++view) {
    for (std::size_t token = 0; token < tokens; ++token) {
      for (std::size_t n = 0; n < c; ++n) {
        const double g = dtokens[(view * tokens + token) * c + n];
        out.position[token * c + n] += g;
        if (token == 0) continue;
        out.bias[n] += g;
        const std::size_t top = (token - 1) / t * p, left = (token - 1) % t * p;
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t y = 0; y < p; ++y)
            for (std::size_t x = 0; x < p; ++x)
              out.weight[((n * 3 + k) * p + y) * p + x] +=
                  g * normalised(images[((view * s + top + y) * s + left + x) * 3 + k], k);
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref
