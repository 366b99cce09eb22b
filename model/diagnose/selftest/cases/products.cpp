// Matrix products and what goes with them.
#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/reference/activation.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/ops/dense/activation.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/transpose.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/gemm.h"
#include "runtime/gemm_matrix.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::selftest {
namespace {

std::size_t product(long a, long b) { return static_cast<std::size_t>(a * b); }

struct ProductTry {
  long m, n, k;
  long c1 = 0;  // of k's channels, those of the second source
  bool affine = false, gathered = false;
  int act = 0;
  bool bias = false, residual = false;
};

ref::GemmCase gemm_case(const ProductTry& t) {
  ref::GemmCase g;
  g.m = t.m, g.n = t.n, g.act = t.act, g.taps = t.gathered ? 3 : 1, g.k = g.taps * t.k;
  g.a.rows = t.gathered ? t.m + 2 : t.m, g.a.c0 = t.k - t.c1, g.a.c1 = t.c1, g.a.silu = t.affine;
  g.a.x0 = random_floats(product(g.a.rows, g.a.c0), 1), g.a.x1 = random_floats(product(g.a.rows, t.c1), 2);
  if (t.affine) {
    g.a.scale = random_floats(product(t.k, 1), 3, 0.5f, 2.0f);
    g.a.shift = random_floats(product(t.k, 1), 4);
  }
  if (t.gathered) {
    std::mt19937 engine(5);
    for (std::size_t i = 0; i < product(t.m, 3); ++i)
      g.map.push_back(static_cast<int>(engine() % static_cast<unsigned>(g.a.rows + 2)) - 1);  // absent ones, too
  }
  g.w = random_floats(product(t.n, g.k), 6);
  if (t.bias) g.bias = random_floats(product(t.n, 1), 7);
  if (t.residual) g.residual = random_floats(product(t.m, t.n), 8);
  return g;
}

void check_gemm(Checks& c, const ProductTry& t) {
  const ref::GemmCase want = gemm_case(t);
  Gemm g;
  const PackedMatrix b = pack_matrix(c.ctx, want.w.data(), want.k, t.n, 1, want.k, "weight");
  g.a = upload_rows(c.ctx, want.a), g.b = &b;
  if (t.gathered) g.a.map = c.up({t.m, 3}, want.map);
  if (t.bias) g.bias = c.up({t.n}, want.bias);
  if (t.residual) g.residual = c.up({t.m, t.n}, want.residual);
  g.activation = static_cast<Activation>(t.act);
  g.out = c.gap({t.m, t.n});
  gemm(c.ctx, g);
  c.close(
      "product", g.out, [&] { return want.all(); }, 1e-5);
}

// Long sums in parts, which a table of tuned parameters alone asks for.
void gemm_in_parts(Checks& c) {
  const TunedDeclaration* of = tuned_declaration(TunedOp::gemm, c.ctx.flavour());
  for (std::size_t i = 0; of && i < of->parameters.size(); ++i) {
    if (of->parameters[i].name != std::string("split")) continue;
    const auto defaults = std::make_shared<const Tuning>(c.ctx.tuning());
    for (const long parts : of->parameters[i].values) {
      TunedValues values = default_values(*of);
      values.values[i] = parts;
      auto tuned = std::make_shared<Tuning>();
      tuned->force(TunedOp::gemm, values);
      c.ctx.use_tuning(std::move(tuned));
      check_gemm(c, {13, 33, 517, 0, false, false, 2, true, true});
    }
    c.ctx.use_tuning(defaults);
  }
}

void gemm_all(Checks& c) {
  for (const auto& [m, n, k] : c.some({std::array<long, 3>{1, 1, 1},
                                       {3, 7, 5},
                                       {11, 31, 13},
                                       {12, 32, 16},
                                       {13, 33, 17},
                                       {63, 65, 31},
                                       {64, 64, 32},
                                       {65, 129, 33},
                                       {12, 7, 300},
                                       {97, 23, 257}}))
    check_gemm(c, {m, n, k});
  // Enough tiles of 128 x 128 for the gpu flavour to take those.
  check_gemm(c, {128L * 2 * c.ctx.device().compute_units + 1, 66, 7});
  for (const int act : {1, 2, 3, 4}) check_gemm(c, {13, 33, 20, 0, false, false, act, true, act % 2 == 0});
  check_gemm(c, {13, 33, 20, 7, true, false, 0, true, true});
  check_gemm(c, {13, 33, 20, 7, false, true, 0, false, true});
  check_gemm(c, {13, 33, 20, 0, true, true, 2, true, false});  // rows that are composed first, being read often
  gemm_in_parts(c);
  // From the device's memory.
  for (const auto& [n, k] : c.some({std::array<long, 2>{1, 1}, {31, 15}, {33, 17}, {65, 100}})) {
    const auto w = random_floats(product(n, k), 9), x = random_floats(product(5, k), 10);
    const PackedMatrix b = pack_matrix(c.ctx, c.up({n, k}, w), k, n, 1, k, "weight");
    c.equal("packed on the device", b.data, c.ctx.read<float>(pack_matrix(c.ctx, w.data(), k, n, 1, k, "weight").data));
    c.keep();
    Gemm g;
    g.a.x0 = c.up({5, k}, x), g.b = &b, g.out = c.gap({5, n});
    gemm(c.ctx, g);
    c.close(
        "product of what the device packed", g.out,
        [&, n = n, k = k] {
          ref::GemmCase want;
          want.a.x0 = x, want.a.rows = want.m = 5, want.a.c0 = want.k = k, want.n = n, want.w = w;
          return want.all();
        },
        1e-5);
  }
  // What follows CLBlast's product, which is not used everywhere.
  const auto x = random_floats(7 * 33, 11), bias = random_floats(33, 12), residual = random_floats(7 * 33, 13);
  for (const int act : {0, 1, 2, 3, 4}) {
    const Tensor out = c.gap({7, 33});
    c.ctx.launch({"gemm_gpu", "gemm_epilogue", ""}, items(7 * 33), {}, c.up({7, 33}, x), 0L, 7L, 33L, c.up({33}, bias),
                 static_cast<long>(act), c.up({7, 33}, residual), written(out), 0L);
    std::vector<double> want;
    for (std::size_t i = 0; i < x.size(); ++i)
      want.push_back(ref::activate(static_cast<double>(x[i]) + bias[i % 33], act) + residual[i]);
    c.close("epilogue", out, want, 1e-6);
  }
}

// Products of rounded operands on emulated fragments, which are exact for small integers. The device's own matrix units
// are tested when mixed precision is requested (runtime/tuning/matrix_probe.h).
void gemm_matrix_all(Checks& c) {
  if (c.ctx.flavour() != Flavour::gpu || c.ctx.switched_off().mixed) return;
  for (const Operands operands : {Operands::bf16, Operands::tf32})
    for (const auto& [m, n, k] : c.some({std::array<long, 3>{1, 1, 1},
                                         {3, 7, 5},
                                         {15, 9, 17},
                                         {16, 8, 16},
                                         {63, 65, 31},
                                         {101, 33, 67},
                                         {64, 64, 32},
                                         {128L * 2 * c.ctx.device().compute_units + 1, 131, 35}})) {
      auto a = random_floats(product(m, k), 1, -15, 15), b = random_floats(product(k, n), 2, -15, 15);
      for (auto* x : {&a, &b})
        for (float& v : *x) v = std::trunc(v);
      MatrixProducts p;
      p.a.x0 = c.up({m, k}, a), p.src_rows = p.m = m, p.b = c.up({k, n}, b), p.n = n;
      p.out = c.gap({m, n}), p.operands = operands;
      gemm_matrix(c.ctx, p);
      std::vector<float> want(product(m, n), 0.0f);
      for (std::size_t i = 0; i < want.size(); ++i)
        for (std::size_t t = 0; t < product(k, 1); ++t)
          want[i] += a[i / product(n, 1) * product(k, 1) + t] * b[t * product(n, 1) + i % product(n, 1)];
      c.equal("product of integers", p.out, want);
    }
  const ref::GemmCase want = gemm_case({41, 43, 27, 7, true, true, 2, true, true});
  MatrixProducts p;
  p.a = upload_rows(c.ctx, want.a), p.a.map = c.up({41, 3}, want.map);
  p.src_rows = want.a.rows, p.m = 41, p.n = 43;
  p.b = pack_matrix(c.ctx, want.w.data(), want.k, 43, 1, want.k, "weight").data;
  p.bias = c.up({43}, want.bias), p.residual = c.up({41, 43}, want.residual), p.activation = Activation::silu;
  p.out = c.gap({41, 43});
  gemm_matrix(c.ctx, p);
  c.close(
      "product of rounded operands", p.out, [&] { return want.all(); }, 8e-3);
}

void transposed_gemm_all(Checks& c) {
  const long wide = 128L * 2 * c.ctx.device().compute_units + 1;
  for (const auto& [rows, m, n] : c.some({std::array<long, 3>{1, 1, 1},
                                          {7, 3, 5},
                                          {101, 12, 32},
                                          {15, 13, 33},
                                          {1025, 64, 65},
                                          {2049, 65, 3},
                                          {5, wide, 66}})) {
    const auto a = random_floats(product(rows, m), 1), b = random_floats(product(rows, n), 2),
               before = random_floats(product(m, n), 3);
    for (const bool add : {false, true}) {
      const TransposedGemm g{c.up({rows, m}, a), c.up({rows, n}, b), add ? c.up({m, n}, before) : c.gap({m, n}), add};
      transposed_gemm(c.ctx, g);
      c.close(
          add ? "sum, added" : "sum", g.out,
          [&, rows = rows, m = m, n = n] {
            auto want = ref::transposed_product(a, b, product(rows, 1), product(m, 1), product(n, 1));
            for (std::size_t i = 0; add && i < want.size(); ++i) want[i] += before[i];
            return want;
          },
          1e-5);
    }
  }
}

void column_sum_all(Checks& c) {
  for (const long rows : c.some({1L, 3L, 63L, 64L, 65L, 1009L, 4097L}))
    for (const long channels : {1L, 17L, 64L}) {
      const auto x = random_floats(product(rows, channels), 1), before = random_floats(product(channels, 1), 2);
      std::vector<double> want(before.begin(), before.end());
      for (std::size_t i = 0; i < x.size(); ++i) want[i % product(channels, 1)] += x[i];
      const Tensor out = c.up({channels}, before);
      column_sum(c.ctx, {c.up({rows, channels}, x), out, true});
      c.close("sums", out, want, 1e-6);
    }
}

void compose_rows_all(Checks& c) {
  for (const long m : c.some({1L, 7L, 64L, 101L})) {
    const ref::GemmCase g = gemm_case({m, 1, 12, 5, true, true});
    RowSource rows = upload_rows(c.ctx, g.a);
    rows.map = c.up({m, 3}, g.map);
    const Tensor out = c.gap({m, 36});
    compose_rows(c.ctx, rows, out);
    std::vector<double> want;
    for (const int row : g.map)
      for (long ch = 0; ch < 12; ++ch) want.push_back(g.a.at(row, ch));
    c.close("rows", out, want, 1e-6);
  }
}

void activation_all(Checks& c) {
  for (const std::size_t n : c.some({1UL, 3UL, 15UL, 16UL, 17UL, 1023UL, 1025UL})) {
    auto x = random_floats(n, 1, -5, 5);
    x[0] = 2;
    const auto dy = random_floats(n, 2, 0.5f, 1.0f);
    for (const int act : {1, 2, 3, 4}) {
      const Shape shape{static_cast<long>(n)};
      std::vector<double> y, dx;
      for (std::size_t i = 0; i < n; ++i) {
        y.push_back(ref::activate(x[i], act));
        dx.push_back(dy[i] * ref::activation_slope(x[i], act));
      }
      const Tensor in = c.up(shape, x), out = c.gap(shape), back = c.gap(shape);
      activation_forward(c.ctx, {in, static_cast<Activation>(act), out});
      c.close("forward", out, y, 1e-6);
      activation_backward(c.ctx, {in, static_cast<Activation>(act), c.up(shape, dy), back});
      c.close("backward", back, dx, 1e-6);
    }
  }
}

void add_columns_all(Checks& c) {
  for (const long width : c.some({1L, 7L, 16L, 33L})) {
    const auto x = random_floats(product(13, width), 1);
    auto want = random_floats(product(13, width + 5), 2);
    const Tensor out = c.up({13, width + 5}, want);
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t w = product(width, 1), row = i / w;
      want[row * (w + 5) + 2 + i % w] += x[i];
    }
    add_columns(c.ctx, {c.up({13, width}, x), out, 2});
    c.equal("columns", out, want);
  }
}

void transpose_all(Checks& c) {
  for (const auto& [a, b] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {16, 15}, {17, 33}, {101, 64}})) {
    const auto x = random_floats(product(a, b), 1), before = random_floats(product(a, b), 2);
    std::vector<float> want(x.size()), sum(x.size());
    for (std::size_t i = 0; i < x.size(); ++i) {
      const std::size_t at = i % product(b, 1) * product(a, 1) + i / product(b, 1);
      want[at] = x[i], sum[at] = before[at] + x[i];
    }
    const Tensor in = c.up({a, b}, x), out = c.gap({b, a}), added = c.up({b, a}, before);
    transpose(c.ctx, {in, out});
    c.equal("columns", out, want);
    transpose(c.ctx, {in, added, true});
    c.equal("columns, added", added, sum);
  }
}

// What peaks are measured with: s = (j + i), then s = s b + a, k times.
void peak_all(Checks& c) {
  const int width = c.ctx.flavour() == Flavour::cpu ? 16 : 4, chains = c.ctx.flavour() == Flavour::cpu ? 24 : 8;
  const long n = 13;
  const Tensor out = c.gap({n, width});
  const std::string defines = "-DWIDTH=" + std::to_string(width);
  c.ctx.launch({"peak", "peak_fma", defines + " -DCHAINS=" + std::to_string(chains)}, items(n, 1), {}, 5L, 0.9f,
               written(out));
  std::vector<double> want;
  for (long i = 0; i < n; ++i) {
    double sum = 0;
    for (int j = 0; j < chains; ++j) {
      double s = static_cast<double>(i + j);
      for (int k = 0; k < 5; ++k) s = s * static_cast<double>(0.9f * 0.5f) + static_cast<double>(0.9f);
      sum += s;
    }
    want.insert(want.end(), static_cast<std::size_t>(width), sum);
  }
  c.close("multiply-adds", out, want, 1e-6);
  const auto a = random_floats(product(n, width), 1), b = random_floats(product(n, width), 2);
  std::vector<double> stream;
  for (std::size_t i = 0; i < a.size(); ++i) stream.push_back(a[i] + 0.5 * static_cast<double>(b[i]));
  const Tensor y = c.gap({n, width});
  c.ctx.launch({"peak", "peak_stream", defines}, items(n, 64), {}, n, 0.5f, c.up({n, width}, a), c.up({n, width}, b),
               written(y));
  c.close("stream", y, stream, 1e-6);
}

}  // namespace

std::vector<Case> product_cases() {
  return {{"column_sum", column_sum_all},
          {"compose_rows", compose_rows_all},
          {"gemm", gemm_all},
          {"gemm_matrix", gemm_matrix_all},
          {"transposed_gemm", transposed_gemm_all},
          {"activation", activation_all},
          {"add_columns", add_columns_all},
          {"transpose", transpose_all},
          {"peak", peak_all}};
}

}  // namespace vsplat::selftest
