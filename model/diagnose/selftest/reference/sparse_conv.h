// Submanifold convolutions in double, from the definition: rows are active voxels, in any order.
#pragma once
#include <vector>

#include "model/diagnose/selftest/reference/gemm.h"

namespace vsplat::ref {

struct SparseConvCase {
  int side = 3;            // of the kernel: 3 or 1
  int r = 0;               // of the grid
  std::vector<int> voxel;  // [P], (i r + j) r + k
  Rows in;                 // composed [P, Cin]
  long cout = 0;
  std::vector<float> w, bias;  // [Cout][side][side][side][Cin], [Cout]

  long taps() const { return static_cast<long>(side) * side * side; }
  // Calls f(row, tap, row of the neighbour there) for all neighbours that are active.
  template <class F>
  void each(const F& f) const {
    const auto at = [&](int v, int axis) { return axis == 0 ? v / (r * r) : axis == 1 ? v / r % r : v % r; };
    for (std::size_t p = 0; p < voxel.size(); ++p)
      for (std::size_t q = 0; q < voxel.size(); ++q) {
        long tap = 0;
        bool near = true;
        for (int axis = 0; axis < 3; ++axis) {
          const int step = at(voxel[q], axis) - at(voxel[p], axis) + side / 2;
          near = near && step >= 0 && step < side;
          tap = tap * side + step;
        }
        if (near) f(static_cast<long>(p), tap, static_cast<long>(q));
      }
  }
};

// [P, Cout]
inline std::vector<double> sparse_conv(const SparseConvCase& c) {
  const long cin = c.in.c0 + c.in.c1;
  const auto i = [](long v) { return static_cast<std::size_t>(v); };
  std::vector<double> out;
  for (std::size_t p = 0; p < c.voxel.size(); ++p) out.insert(out.end(), c.bias.begin(), c.bias.end());
  c.each([&](long p, long tap, long q) {
    for (long n = 0; n < c.cout; ++n)
      for (long ch = 0; ch < cin; ++ch)
        out[i(p * c.cout + n)] += static_cast<double>(c.w[i((n * c.taps() + tap) * cin + ch)]) * c.in.at(q, ch);
  });
  return out;
}

struct SparseConvGradient {
  std::vector<double> dx, dw, dbias;  // by the composed inputs [P, Cin], and shaped as w and bias
};

// For a loss whose derivative by the outputs is dy [P, Cout].
inline SparseConvGradient sparse_conv_backward(const SparseConvCase& c, const std::vector<float>& dy) {
  const long cin = c.in.c0 + c.in.c1;
  const auto i = [](long v) { return static_cast<std::size_t>(v); };
  SparseConvGradient g{std::vector<double>(c.voxel.size() * i(cin)), std::vector<double>(c.w.size()),
                       std::vector<double>(c.bias.size())};
  for (std::size_t at = 0; at < dy.size(); ++at) g.dbias[at % i(c.cout)] += dy[at];
  c.each([&](long p, long tap, long q) {
    for (long ch = 0; ch < cin; ++ch) {
      const double x = c.in.at(q, ch);
      for (long n = 0; n < c.cout; ++n) {
        const double d = dy[i(p * c.cout + n)];
        const std::size_t w = i((n * c.taps() + tap) * cin + ch);
        g.dw[w] += d * x;
        g.dx[i(q * cin + ch)] += d * c.w[w];
      }
    }
  });
  return g;
}

}  // namespace vsplat::ref
