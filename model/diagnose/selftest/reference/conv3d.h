// Convolutions of channels-last volumes in double, one output at a time.
#pragma once
#include <array>
#include <vector>

#include "model/diagnose/selftest/reference/gemm.h"

namespace vsplat::ref {

// out[p, n] = bias[n] + sum over taps and channels of w[n][c][tap] in[stride p + tap - padding, c] (+ residual); what
// lies outside the volume is zero.
struct ConvCase {
  Rows in;                     // rows are voxels, z fastest
  std::array<long, 3> size{};  // X, Y, Z
  long side = 3, stride = 1, padding = 1;
  long cout = 0;
  std::vector<float> w;               // [Cout][Cin][side][side][side]
  std::vector<float> bias, residual;  // [Cout], [out voxels, Cout] or empty

  std::array<long, 3> out_size() const {
    std::array<long, 3> out{};
    for (int d = 0; d < 3; ++d) {
      const long room = size[d] + 2 * padding - side;
      out[d] = room < 0 ? 0 : room / stride + 1;
    }
    return out;
  }

  double at(long x, long y, long z, long n) const {
    const long cin = in.c0 + in.c1, taps = side * side * side;
    double sum = bias.empty() ? 0 : bias[static_cast<std::size_t>(n)];
    for (long i = 0; i < side; ++i)
      for (long j = 0; j < side; ++j)
        for (long k = 0; k < side; ++k) {
          const long px = x * stride + i - padding, py = y * stride + j - padding, pz = z * stride + k - padding;
          if (px < 0 || px >= size[0] || py < 0 || py >= size[1] || pz < 0 || pz >= size[2]) continue;
          for (long c = 0; c < cin; ++c)
            sum += in.at((px * size[1] + py) * size[2] + pz, c) *
                   static_cast<double>(w[static_cast<std::size_t>((n * cin + c) * taps + (i * side + j) * side + k)]);
        }
    if (!residual.empty()) {
      const auto out = out_size();
      sum += residual[static_cast<std::size_t>(((x * out[1] + y) * out[2] + z) * cout + n)];
    }
    return sum;
  }

  std::vector<double> all() const {
    const auto out = out_size();
    std::vector<double> values;
    for (long x = 0; x < out[0]; ++x)
      for (long y = 0; y < out[1]; ++y)
        for (long z = 0; z < out[2]; ++z)
          for (long n = 0; n < cout; ++n) values.push_back(at(x, y, z, n));
    return values;
  }
};

// By the composed inputs [voxels, Cin], the weights and the biases, for a loss whose derivative by the outputs is dy
// [out voxels, Cout].
struct ConvGradient {
  std::vector<double> dx, dw, dbias;
};

inline ConvGradient conv_backward(const ConvCase& c, const std::vector<float>& dy) {
  const long cin = c.in.c0 + c.in.c1, taps = c.side * c.side * c.side;
  const auto size = [](long n) { return static_cast<std::size_t>(n); };
  ConvGradient g{std::vector<double>(size(c.in.rows * cin)), std::vector<double>(c.w.size()),
                 std::vector<double>(size(c.cout))};
  const auto out = c.out_size();
  for (long p = 0; p < out[0] * out[1] * out[2]; ++p) {
    const long at[3] = {p / (out[1] * out[2]), p / out[2] % out[1], p % out[2]};
    for (long n = 0; n < c.cout; ++n) g.dbias[size(n)] += dy[size(p * c.cout + n)];
    for (long tap = 0; tap < taps; ++tap) {
      const long offset[3] = {tap / (c.side * c.side), tap / c.side % c.side, tap % c.side};
      long row = 0;
      bool inside = true;
      for (int d = 0; d < 3; ++d) {
        const long q = at[d] * c.stride + offset[d] - c.padding;
        inside = inside && q >= 0 && q < c.size[size(d)];
        row = row * c.size[size(d)] + q;
      }
      if (!inside) continue;
      for (long ch = 0; ch < cin; ++ch) {
        const double x = c.in.at(row, ch);
        for (long n = 0; n < c.cout; ++n) {
          const std::size_t w = size((n * cin + ch) * taps + tap);
          g.dw[w] += x * dy[size(p * c.cout + n)];
          g.dx[size(row * cin + ch)] += static_cast<double>(c.w[w]) * dy[size(p * c.cout + n)];
        }
      }
    }
  }
  return g;
}

}  // namespace vsplat::ref
