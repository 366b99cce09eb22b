#include "model/diagnose/selftest/reference/gemm.h"

#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/pairs.h"
#include "model/diagnose/selftest/inputs/products.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "runtime/gemm.h"
#include "runtime/gemm_matrix.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::selftest {
namespace {

void check_gemm(Checks& c, const ProductTry& t, double tolerance = 1e-5) {
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
      "product", g.out, [&] { return want.all(); }, tolerance);
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
    const auto w = random_floats(size_of(n, k), 9), x = random_floats(size_of(5, k), 10);
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
      auto a = random_floats(size_of(m, k), 1, -15, 15), b = random_floats(size_of(k, n), 2, -15, 15);
      for (auto* x : {&a, &b})
        for (float& v : *x) v = std::trunc(v);
      MatrixProducts p;
      p.a.x0 = c.up({m, k}, a), p.src_rows = p.m = m, p.b = c.up({k, n}, b), p.n = n;
      p.out = c.gap({m, n}), p.operands = operands;
      gemm_matrix(c.ctx, p);
      std::vector<float> want(size_of(m, n), 0.0f);
      for (std::size_t i = 0; i < want.size(); ++i)
        for (std::size_t t = 0; t < size_of(k, 1); ++t)
          want[i] += a[i / size_of(n, 1) * size_of(k, 1) + t] * b[t * size_of(n, 1) + i % size_of(n, 1)];
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

// Products of pairs of rounded operands in the cpu flavour, by the processor's instructions if it has them.
void gemm_pairs_all(Checks& c) {
  if (!multiplies_pairs(c)) return;
  const AlwaysPairs always;
  const auto integers = [](long count, std::uint32_t seed) {
    auto out = random_floats(size_of(count, 1), seed, -15, 15);
    for (float& v : out) v = std::trunc(v);
    return out;
  };
  for (const auto& [m, n, k] :
       c.some({std::array<long, 3>{1, 1, 1},
               {3, 7, 5},
               {11, 31, 13},
               {12, 32, 16},
               {13, 33, 17},
               {101, 65, 31},
               {25, 64, 1030}},
              {{5, 3, 0}, {7, 1, 2}, {1, 3, 512}, {12, 7, 511}, {13, 97, 513}, {97, 23, 1024}, {109, 129, 37}})) {
    const auto a = integers(m * k, 1), b = integers(k * n, 2);
    std::vector<float> want(size_of(m, n), 0.0f);
    for (std::size_t i = 0; i < want.size(); ++i)
      for (std::size_t t = 0; t < size_of(k, 1); ++t)
        want[i] += a[i / size_of(n, 1) * size_of(k, 1) + t] * b[t * size_of(n, 1) + i % size_of(n, 1)];
    for (const bool on_host : {true, false}) {
      if (!on_host && k == 0) continue;
      const PackedMatrix packed = on_host ? pack_matrix(c.ctx, b.data(), k, n, n, 1, "B")
                                          : pack_matrix(c.ctx, c.up({k, n}, b), k, n, n, 1, "B");
      c.keep();
      Gemm g;
      g.a.x0 = c.up({m, k}, a), g.b = &packed, g.out = c.gap({m, n});
      gemm(c.ctx, g);
      c.equal("pairs of integers", g.out, want);
    }
    // A^T of the same numbers: [k, m]^T [k, n], with and without what is there.
    const auto at = integers(k * m, 3), before = integers(m * n, 4);
    for (const bool add : {false, true}) {
      const TransposedGemm g{c.up({k, m}, at), c.up({k, n}, b), add ? c.up({m, n}, before) : c.gap({m, n}), add};
      transposed_gemm(c.ctx, g);
      std::vector<float> sums = add ? before : std::vector<float>(size_of(m, n), 0.0f);
      for (std::size_t i = 0; i < sums.size(); ++i)
        for (std::size_t t = 0; t < size_of(k, 1); ++t)
          sums[i] += at[t * size_of(m, 1) + i / size_of(n, 1)] * b[t * size_of(n, 1) + i % size_of(n, 1)];
      c.equal("pairs of integers, transposed", g.out, sums);
    }
  }
  // Composed rows, with pairs inside a source and across two, each within the error of rounded operands.
  for (const long c1 : {0L, 6L, 7L})
    for (const long c0 : {20L, 27L})
      for (const bool gathered : {false, true})
        for (const int act : {0, 2}) check_gemm(c, {41, 43, c0 + c1, c1, act > 0, gathered, act, true, act > 0}, 8e-3);
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
    const auto a = random_floats(size_of(rows, m), 1), b = random_floats(size_of(rows, n), 2),
               before = random_floats(size_of(m, n), 3);
    for (const bool add : {false, true}) {
      const TransposedGemm g{c.up({rows, m}, a), c.up({rows, n}, b), add ? c.up({m, n}, before) : c.gap({m, n}), add};
      transposed_gemm(c.ctx, g);
      c.close(
          add ? "sum, added" : "sum", g.out,
          [&, rows = rows, m = m, n = n] {
            auto want = ref::transposed_product(a, b, size_of(rows, 1), size_of(m, 1), size_of(n, 1));
            for (std::size_t i = 0; add && i < want.size(); ++i) want[i] += before[i];
            return want;
          },
          1e-5);
    }
  }
}

}  // namespace

VSPLAT_CASES(gemm, {"gemm", gemm_all}, {"gemm_matrix", gemm_matrix_all}, {"gemm_pairs", gemm_pairs_all},
             {"transposed_gemm", transposed_gemm_all})

}  // namespace vsplat::selftest
