// Matrix products of random numbers.
#pragma once
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/gemm.h"

namespace vsplat::selftest {

struct ProductTry {
  long m, n, k;
  long c1 = 0;  // of k's channels, those of the second source
  bool affine = false, gathered = false;
  int act = 0;
  bool bias = false, residual = false;
};

inline ref::GemmCase gemm_case(const ProductTry& t) {
  ref::GemmCase g;
  g.m = t.m, g.n = t.n, g.act = t.act, g.taps = t.gathered ? 3 : 1, g.k = g.taps * t.k;
  g.a.rows = t.gathered ? t.m + 2 : t.m, g.a.c0 = t.k - t.c1, g.a.c1 = t.c1, g.a.silu = t.affine;
  g.a.x0 = random_floats(size_of(g.a.rows, g.a.c0), 1), g.a.x1 = random_floats(size_of(g.a.rows, t.c1), 2);
  if (t.affine) {
    g.a.scale = random_floats(size_of(t.k, 1), 3, 0.5f, 2.0f);
    g.a.shift = random_floats(size_of(t.k, 1), 4);
  }
  if (t.gathered) {
    std::mt19937 engine(5);
    for (std::size_t i = 0; i < size_of(t.m, 3); ++i)
      g.map.push_back(static_cast<int>(engine() % static_cast<unsigned>(g.a.rows + 2)) - 1);  // absent ones, too
  }
  g.w = random_floats(size_of(t.n, g.k), 6);
  if (t.bias) g.bias = random_floats(size_of(t.n, 1), 7);
  if (t.residual) g.residual = random_floats(size_of(t.m, t.n), 8);
  return g;
}

}  // namespace vsplat::selftest
