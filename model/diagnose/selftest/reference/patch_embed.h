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

// Pictures of height x width, in patches of p, with `prefix` tokens before the patches of each view.
struct PatchSizes {
  std::size_t v, height, width, p, prefix = 1;
  bool positions = true;  // of patches

  std::size_t tokens() const { return prefix + (height / p) * (width / p); }
  std::size_t rows() const { return positions ? tokens() : prefix; }  // of the position
};

// images [v, height, width, 3], weight [c, 3, p, p], bias [c], position [rows, c] -> [v, tokens, c]
template <class F>
std::vector<double> patch_embed(const std::vector<float>& images, const PatchSizes& z, const std::vector<F>& weight,
                                const std::vector<F>& bias, const std::vector<F>& position) {
  const std::size_t c = bias.size(), p = z.p, across = z.width / p;
  std::vector<double> out;
  for (std::size_t view = 0; view < z.v; ++view) {
    for (std::size_t n = 0; n < z.prefix * c; ++n) out.push_back(position[n]);
    for (std::size_t py = 0; py < z.height / p; ++py) {
      for (std::size_t px = 0; px < across; ++px) {
        for (std::size_t n = 0; n < c; ++n) {
          double sum = bias[n];
          for (std::size_t k = 0; k < 3; ++k) {
            for (std::size_t y = 0; y < p; ++y) {
              for (std::size_t x = 0; x < p; ++x) {
                const double pixel = images[((view * z.height + py * p + y) * z.width + px * p + x) * 3 + k];
                sum += weight[((n * 3 + k) * p + y) * p + x] * normalised(pixel, k);
              }
            }
          }
          out.push_back(sum + (z.positions ? position[(z.prefix + py * across + px) * c + n] : 0));
        }
      }
    }
  }
  return out;
}

struct PatchEmbedGradients {
  std::vector<double> weight;    // [c, 3, p, p]
  std::vector<double> bias;      // [c]
  std::vector<double> position;  // [rows, c]
};

// The gradient of sum(dtokens * patch_embed(...)).
inline PatchEmbedGradients patch_embed_backward(const std::vector<float>& images, const PatchSizes& z, std::size_t c,
                                                const std::vector<double>& dtokens) {
  const std::size_t p = z.p, across = z.width / p, tokens = z.tokens();
  PatchEmbedGradients out{std::vector<double>(c * 3 * p * p), std::vector<double>(c),
                          std::vector<double>(z.rows() * c)};
  for (std::size_t view = 0; view < z.v; ++view) {
    for (std::size_t token = 0; token < tokens; ++token) {
      for (std::size_t n = 0; n < c; ++n) {
        const double g = dtokens[(view * tokens + token) * c + n];
        if (token < z.rows()) out.position[token * c + n] += g;
        if (token < z.prefix) continue;
        out.bias[n] += g;
        const std::size_t patch = token - z.prefix, top = patch / across * p, left = patch % across * p;
        for (std::size_t k = 0; k < 3; ++k)
          for (std::size_t y = 0; y < p; ++y)
            for (std::size_t x = 0; x < p; ++x)
              out.weight[((n * 3 + k) * p + y) * p + x] +=
                  g * normalised(images[((view * z.height + top + y) * z.width + left + x) * 3 + k], k);
      }
    }
  }
  return out;
}

}  // namespace vsplat::ref
