// out = act(A B + bias) + residual in double, one element at a time.
#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace vsplat::ref {

inline double silu(double x) { return x / (1 + std::exp(-x)); }
inline double gelu(double x) { return 0.5 * x * (1 + std::erf(x / std::sqrt(2.0))); }
inline double gelu_tanh(double x) {
  return 0.5 * x * (1 + std::tanh(std::sqrt(2 / std::acos(-1.0)) * (x + 0.044715 * x * x * x)));
}
// 0 none, 1 GELU, 2 SiLU, 3 ReLU, 4 GELU by tanh
inline double activate(double x, int act) {
  return act == 1 ? gelu(x) : act == 2 ? silu(x) : act == 4 ? gelu_tanh(x) : act == 3 && x < 0 ? 0 : x;
}

// Channel c of source row `row` after concatenation, affine and SiLU; a row that is not there is 0.
struct Rows {
  std::vector<float> x0, x1;        // [rows, c0], [rows, c1]
  std::vector<float> scale, shift;  // [c0 + c1] or empty
  long rows = 0, c0 = 0, c1 = 0;
  bool silu = false;

  double at(long row, long c) const {
    if (row < 0 || row >= rows) return 0;
    const auto i = [](long v) { return static_cast<std::size_t>(v); };
    double v = c < c0 ? x0[i(row * c0 + c)] : x1[i(row * c1 + c - c0)];
    if (!scale.empty()) v = v * scale[i(c)] + shift[i(c)];
    return silu ? ref::silu(v) : v;
  }
};

struct GemmCase {
  Rows a;
  std::vector<int> map;  // [m, taps] or empty
  long taps = 1;
  std::vector<float> w;               // a Linear's weight [n, k]
  std::vector<float> bias, residual;  // [n], [m, n] or empty
  long m = 0, n = 0, k = 0;
  int act = 0;

  double at(long i, long j) const {
    const auto u = [](long v) { return static_cast<std::size_t>(v); };
    double sum = bias.empty() ? 0 : bias[u(j)];
    const long channels = a.c0 + a.c1;
    for (long t = 0; t < taps; ++t) {
      const long row = map.empty() ? i : map[u(i * taps + t)];
      for (long c = 0; c < channels; ++c) sum += a.at(row, c) * static_cast<double>(w[u(j * k + t * channels + c)]);
    }
    sum = activate(sum, act);
    return residual.empty() ? sum : sum + static_cast<double>(residual[u(i * n + j)]);
  }

  std::vector<double> all() const {
    std::vector<double> out;
    for (long i = 0; i < m; ++i)
      for (long j = 0; j < n; ++j) out.push_back(at(i, j));
    return out;
  }
};

// A^T B of a [rows, m] and b [rows, n].
inline std::vector<double> transposed_product(const std::vector<float>& a, const std::vector<float>& b,
                                              std::size_t rows, std::size_t m, std::size_t n) {
  std::vector<double> out(m * n);
  for (std::size_t r = 0; r < rows; ++r)
    for (std::size_t i = 0; i < m; ++i)
      for (std::size_t j = 0; j < n; ++j) out[i * n + j] += static_cast<double>(a[r * m + i]) * b[r * n + j];
  return out;
}

}  // namespace vsplat::ref
