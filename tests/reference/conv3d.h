// Convolutions of channels-last volumes in double, one output at a time.
#pragma once
#include <array>
#include <vector>

#include "tests/reference/gemm.h"

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

}  // namespace vsplat::ref
