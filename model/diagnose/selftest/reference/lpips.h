// LPIPS' operations beside convolutions, one value at a time.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace vsplat::ref {

// in [H, W, C] -> [h, w, C]: the largest value of each window of side x side, `stride` apart.
inline std::vector<double> max_pool(const std::vector<float>& in, int h_in, int w_in, int c, int side, int stride) {
  std::vector<double> out;
  for (int y = 0; y + side <= h_in; y += stride)
    for (int x = 0; x + side <= w_in; x += stride)
      for (int k = 0; k < c; ++k) {
        double most = -1e300;
        for (int v = y; v < y + side; ++v)
          for (int u = x; u < x + side; ++u) most = std::max(most, static_cast<double>(in[(v * w_in + u) * c + k]));
        out.push_back(most);
      }
  return out;
}

// in [H, W, C], w [Cout, Cin, side, side], zero padding -> [h, w, Cout].
inline std::vector<double> conv2d(const std::vector<float>& in, int h_in, int w_in, int cin,
                                  const std::vector<float>& w, int cout, int side, int stride, int pad) {
  std::vector<double> out;
  for (int y = -pad; y + side <= h_in + pad; y += stride)
    for (int x = -pad; x + side <= w_in + pad; x += stride)
      for (int n = 0; n < cout; ++n) {
        double sum = 0;
        for (int c = 0; c < cin; ++c)
          for (int v = 0; v < side; ++v)
            for (int u = 0; u < side; ++u) {
              if (y + v < 0 || y + v >= h_in || x + u < 0 || x + u >= w_in) continue;
              sum += static_cast<double>(in[((y + v) * w_in + x + u) * cin + c]) *
                     w[((n * cin + c) * side + v) * side + u];
            }
        out.push_back(sum);
      }
  return out;
}

// a, b [P, C], weight [C] -> [P].
inline std::vector<double> feature_distance(const std::vector<float>& a, const std::vector<float>& b,
                                            const std::vector<float>& weight) {
  const std::size_t c = weight.size();
  std::vector<double> out;
  for (std::size_t p = 0; p < a.size() / c; ++p) {
    double aa = 0, bb = 0, sum = 0;
    for (std::size_t k = 0; k < c; ++k) {
      aa += std::pow(a[p * c + k], 2.0);
      bb += std::pow(b[p * c + k], 2.0);
    }
    for (std::size_t k = 0; k < c; ++k)
      sum += weight[k] * std::pow(a[p * c + k] / (std::sqrt(aa) + 1e-10) - b[p * c + k] / (std::sqrt(bb) + 1e-10), 2.0);
    out.push_back(sum);
  }
  return out;
}

}  // namespace vsplat::ref
