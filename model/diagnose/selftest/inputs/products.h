// Matrix products of random numbers.
#pragma once
#include <memory>

#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {

struct ProductTry {
  long m, n, k;
  long c1 = 0;  // of k's channels, those of the second source
  bool affine = false;
  long taps = 0;  // > 0: gathered, with absent rows
  int act = 0;
  bool bias = false, residual = false;
  bool silu = affine;
};

inline ref::GemmCase gemm_case(const ProductTry& t) {
  ref::GemmCase g;
  g.m = t.m, g.n = t.n, g.act = t.act, g.taps = t.taps > 0 ? t.taps : 1, g.k = g.taps * t.k;
  g.a.rows = t.taps > 0 ? t.m + 2 : t.m, g.a.c0 = t.k - t.c1, g.a.c1 = t.c1, g.a.silu = t.silu;
  g.a.x0 = random_floats(size_of(g.a.rows, g.a.c0), 1), g.a.x1 = random_floats(size_of(g.a.rows, t.c1), 2);
  if (t.affine) {
    g.a.scale = random_floats(size_of(t.k, 1), 3, 0.5f, 2.0f);
    g.a.shift = random_floats(size_of(t.k, 1), 4);
  }
  if (t.taps > 0) {
    std::mt19937 engine(5);
    for (std::size_t i = 0; i < size_of(t.m, t.taps); ++i) {
      // In each of the ways that a map allows.
      const auto absent = engine() % 6;
      const int row = static_cast<int>(engine() % static_cast<unsigned>(g.a.rows));
      g.map.push_back(absent == 0 ? -1 : absent == 1 ? static_cast<int>(g.a.rows) + row : row);
    }
  }
  g.w = random_floats(size_of(t.n, g.k), 6);
  if (t.bias) g.bias = random_floats(size_of(t.n, 1), 7);
  if (t.residual) g.residual = random_floats(size_of(t.m, t.n), 8);
  return g;
}

// Owns what its Gemm points to.
struct ProductOnDevice {
  PackedMatrix b;
  Gemm g;
};

inline std::unique_ptr<ProductOnDevice> upload_product(Context& ctx, const ref::GemmCase& c) {
  auto d = std::make_unique<ProductOnDevice>();
  d->b = pack_matrix(ctx, c.w.data(), c.k, c.n, 1, c.k, "weight");
  d->g.b = &d->b, d->g.a = upload_rows(ctx, c.a);
  if (!c.map.empty()) d->g.a.map = ctx.upload({c.m, c.taps}, c.map, Type::i32);
  if (!c.bias.empty()) d->g.bias = ctx.upload({c.n}, c.bias);
  if (!c.residual.empty()) d->g.residual = ctx.upload({c.m, c.n}, c.residual);
  d->g.activation = static_cast<Activation>(c.act);
  d->g.out = ctx.upload({c.m, c.n}, nans(size_of(c.m, c.n)));
  return d;
}

}  // namespace vsplat::selftest
