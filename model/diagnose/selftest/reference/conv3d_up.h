// The transposed convolution 2x2x2 in double, from the definition.
#pragma once
#include <vector>

namespace vsplat::ref {

struct Conv3dUpCase {
  std::size_t x = 1, y = 1, z = 1, cin = 1, cout = 1;
  std::vector<float> in, w, bias;  // [X Y Z, Cin], [Cin, Cout, 2, 2, 2], [Cout] or empty

  // visit(voxel of the input, corner, voxel of the output) for each pair that meets.
  template <class Visit>
  void each(Visit visit) const {
    for (std::size_t i = 0; i < x * y * z; ++i)
      for (std::size_t a = 0; a < 8; ++a) {
        const std::size_t ox = 2 * (i / (y * z)) + a / 4, oy = 2 * (i / z % y) + a / 2 % 2, oz = 2 * (i % z) + a % 2;
        visit(i, a, (ox * 2 * y + oy) * 2 * z + oz);
      }
  }

  std::vector<double> forward() const {
    std::vector<double> out(8 * x * y * z * cout, 0);
    each([&](std::size_t i, std::size_t a, std::size_t o) {
      for (std::size_t c = 0; c < cout; ++c) {
        out[o * cout + c] = bias.empty() ? 0 : bias[c];
        for (std::size_t k = 0; k < cin; ++k)
          out[o * cout + c] += static_cast<double>(in[i * cin + k]) * w[(k * cout + c) * 8 + a];
      }
    });
    return out;
  }

  struct Gradients {
    std::vector<double> in, w, bias;
  };
  Gradients backward(const std::vector<float>& dy) const {
    Gradients g{std::vector<double>(in.size()), std::vector<double>(w.size()), std::vector<double>(cout)};
    each([&](std::size_t i, std::size_t a, std::size_t o) {
      for (std::size_t c = 0; c < cout; ++c) {
        const double d = dy[o * cout + c];
        g.bias[c] += d;
        for (std::size_t k = 0; k < cin; ++k) {
          g.in[i * cin + k] += d * w[(k * cout + c) * 8 + a];
          g.w[(k * cout + c) * 8 + a] += d * in[i * cin + k];
        }
      }
    });
    return g;
  }
};

}  // namespace vsplat::ref
