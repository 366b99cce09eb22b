#include "model/diagnose/selftest/reference/gemm.h"

#include <array>
#include <cmath>
#include <memory>
#include <string>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/pairs.h"
#include "model/diagnose/selftest/inputs/products.h"
#include "runtime/gemm.h"
#include "runtime/gemm_matrix.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::selftest {
namespace {

void check_gemm(Checks& c, const ProductTry& t, double tolerance = 1e-5) {
  const ref::GemmCase want = gemm_case(t);
  const auto d = upload_product(c.ctx, want);
  gemm(c.ctx, d->g);
  c.close(
      "product", d->g.out, [&] { return want.all(); }, tolerance);
  if (!c.all || !t.residual) return;
  const auto got = c.ctx.read<float>(d->g.out);
  d->g.out = d->g.residual;  // which may be the output
  gemm(c.ctx, d->g);
  c.equal("product, added to the output", d->g.out, got);
}

// What only the tests run: every size about a tile, and every composition and epilogue.
void check_every_gemm(Checks& c) {
  for (const long m : {1, 3, 11, 12, 13, 25})
    for (const long n : {1, 7, 22, 23, 31, 32, 33, 64})
      for (const long k : {1, 15, 16, 17, 35}) check_gemm(c, {m, n, k, 0, false, 0, 0, true});
  for (const auto& [m, n, k] : {std::array<long, 3>{130, 97, 71}, {65, 129, 300}, {0, 5, 3}, {4, 0, 3}})
    check_gemm(c, {m, n, k, 0, false, 0, 0, true});
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true})
        for (const long taps : {0L, 1L, 8L, 27L})
          for (const auto& [n, c0] : {std::pair{33L, 19L}, {33L, 32L}, {36L, 32L}})  // 36: a multiple of four elements
            check_gemm(c, {13, n, c0 + c1, c1, affine, taps, 0, true, false, silu});
  for (const bool bias : {false, true})
    for (const bool residual : {false, true})
      for (const int act : {0, 1, 2})
        for (const long n : {20L, 22L, 64L}) check_gemm(c, {25, n, 18, 0, false, 0, act, bias, residual});
  // Enough tiles that the gpu flavour uses large ones, two per unit, with tails in both directions; few columns: none.
  check_gemm(c, {128L * c.ctx.device().compute_units + 5, 134, 37, 0, false, 0, 2, true, true});
  check_gemm(c, {300, 5, 37, 0, false, 0, 2, true, true});
  check_gemm(c, {5, 7, 0, 0, false, 0, 2, true, true});  // an empty sum is zero, which leaves act(bias) + residual
  check_gemm(c, {30, 40, 21, 0, false, 0, 2, true, true});
  check_gemm(c, {800, 7, 128, 0, false, 27, 0, true});  // packed in several pieces
  check_gemm(c, {100, 70, 64, 14, true, 3, 1, true, true});
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
      check_gemm(c, {13, 33, 517, 0, false, 0, 2, true, true});
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
  for (const int act : {1, 2, 3, 4}) check_gemm(c, {13, 33, 20, 0, false, 0, act, true, act % 2 == 0});
  check_gemm(c, {13, 33, 20, 7, true, 0, 0, true, true});
  check_gemm(c, {13, 33, 20, 7, false, 3, 0, false, true});
  check_gemm(c, {13, 33, 20, 0, true, 3, 2, true, false});  // rows that are composed first, being read often
  gemm_in_parts(c);
  if (c.all) check_every_gemm(c);
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

std::vector<float> random_integers(std::size_t count, std::uint32_t seed) {
  auto out = random_floats(count, seed, -15, 15);
  for (float& v : out) v = std::trunc(v);
  return out;
}

// [m, k] times [k, n]: exact in any order.
std::vector<float> integer_product(const std::vector<float>& a, const std::vector<float>& b, long m, long n, long k) {
  std::vector<float> out(size_of(m, n), 0.0f);
  for (std::size_t i = 0; i < out.size(); ++i)
    for (std::size_t t = 0; t < size_of(k); ++t)
      out[i] += a[i / size_of(n) * size_of(k) + t] * b[t * size_of(n) + i % size_of(n)];
  return out;
}

// Products of rounded operands on emulated fragments, which are exact for small integers. The device's own matrix units
// are tested when mixed precision is requested (runtime/tuning/matrix_probe.h).
void gemm_matrix_all(Checks& c) {
  if (c.ctx.flavour() != Flavour::gpu || c.ctx.switched_off().mixed) return;
  std::vector<std::array<long, 3>> sizes = c.some({std::array<long, 3>{1, 1, 1},
                                                   {3, 7, 5},
                                                   {15, 9, 17},
                                                   {16, 8, 16},
                                                   {63, 65, 31},
                                                   {101, 33, 67},
                                                   {64, 64, 32},
                                                   {128L * 2 * c.ctx.device().compute_units + 1, 131, 35}},
                                                  {{65, 33, 1009}});
  for (const long size : {1, 3, 7, 8, 15, 16, 17, 31, 32, 33, 63, 64, 65, 101, 127, 128, 129})
    if (c.all)
      sizes.insert(sizes.end(), {std::array<long, 3>{size, 5, 3}, {3, size, 5}, {5, 3, size}, {size, size, size}});
  for (const Operands operands : {Operands::bf16, Operands::tf32})
    for (const auto& [m, n, k] : sizes) {
      const auto a = random_integers(size_of(m, k), 1), b = random_integers(size_of(k, n), 2);
      MatrixProducts p;
      p.a.x0 = c.up({m, k}, a), p.src_rows = p.m = m, p.b = c.up({k, n}, b), p.n = n;
      p.out = c.gap({m, n}), p.operands = operands;
      gemm_matrix(c.ctx, p);
      c.equal("product of integers", p.out, integer_product(a, b, m, n, k));
    }
  const auto rounded = [&](const ProductTry& t, Operands operands, double tolerance) {
    const ref::GemmCase want = gemm_case(t);
    const auto d = upload_product(c.ctx, want);
    MatrixProducts p;
    p.a = d->g.a, p.src_rows = want.a.rows, p.m = t.m, p.n = t.n, p.b = d->b.data, p.operands = operands;
    p.bias = d->g.bias, p.residual = d->g.residual, p.activation = d->g.activation, p.out = d->g.out;
    gemm_matrix(c.ctx, p);
    c.close(
        "product of rounded operands", p.out, [&] { return want.all(); }, tolerance);
  };
  rounded({41, 43, 27, 7, true, 3, 2, true, true}, MatrixProducts().operands, 8e-3);
  if (!c.all) return;
  // Rows with a multiple of four elements are loaded into local memory in another way.
  for (const Operands operands : {Operands::bf16, Operands::tf32})
    for (const auto& [c0, c1, n] :
         {std::array<long, 3>{19, 0, 43}, {19, 5, 43}, {20, 0, 44}, {20, 16, 44}, {20, 5, 44}})
      for (const bool affine : {false, true})
        for (const long taps : {0L, 8L, 27L})
          for (const int act : {0, 1, 2, 3, 4})
            rounded({37, n, c0 + c1, c1, affine, taps, act, true, act % 2 == 0}, operands,
                    operands == Operands::bf16 ? 8e-3 : 1e-3);
}

// Products of pairs of rounded operands in the cpu flavour, by the processor's instructions if it has them.
void gemm_pairs_all(Checks& c) {
  if (!multiplies_pairs(c)) return;
  const AlwaysPairs always;
  for (const auto& [m, n, k] :
       c.some({std::array<long, 3>{1, 1, 1},
               {3, 7, 5},
               {11, 31, 13},
               {12, 32, 16},
               {13, 33, 17},
               {101, 65, 31},
               {25, 64, 1030}},
              {{5, 3, 0}, {7, 1, 2}, {1, 3, 512}, {12, 7, 511}, {13, 97, 513}, {97, 23, 1024}, {109, 129, 37}})) {
    const auto a = random_integers(size_of(m, k), 1), b = random_integers(size_of(k, n), 2),
               want = integer_product(a, b, m, n, k);
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
    const auto at = random_integers(size_of(k, m), 3), before = random_integers(size_of(m, n), 4);
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
        for (const int act : {0, 2})
          check_gemm(c, {41, 43, c0 + c1, c1, act > 0, gathered ? 3 : 0, act, true, act > 0}, 8e-3);
}

// All numbers are `low` or more.
void transposed_gemm_of(Checks& c, long rows, long m, long n, float low = -1, double tolerance = 1e-5) {
  const auto a = random_floats(size_of(rows, m), 1, low), b = random_floats(size_of(rows, n), 2, low),
             before = random_floats(size_of(m, n), 3);
  for (const bool add : {false, true}) {
    const TransposedGemm g{c.up({rows, m}, a), c.up({rows, n}, b), add ? c.up({m, n}, before) : c.gap({m, n}), add};
    transposed_gemm(c.ctx, g);
    c.close(
        add ? "sum, added" : "sum", g.out,
        [&] {
          auto want = ref::transposed_product(a, b, size_of(rows), size_of(m), size_of(n));
          return add ? plus(std::move(want), before) : want;
        },
        tolerance);
  }
}

void transposed_gemm_all(Checks& c) {
  const long wide = 128L * 2 * c.ctx.device().compute_units + 1;
  for (const auto& [rows, m, n] : c.some({std::array<long, 3>{1, 1, 1},
                                          {7, 3, 5},
                                          {101, 12, 32},
                                          {15, 13, 33},
                                          {1025, 64, 65},
                                          {2049, 65, 3},
                                          {5, wide, 66}},
                                         {{1023, 13, 35},
                                          {1024, 13, 35},
                                          {1025, 13, 35},
                                          {3001, 13, 35},
                                          {1300, 130, 133},
                                          {5000, 33, 40},
                                          // Memory suffices for only one or two sums at a time.
                                          {5000, 2800, 3},
                                          {2500, 4500, 2}}))
    transposed_gemm_of(c, rows, m, n);
  if (!c.all) return;
  for (const long rows : {1L, 3L, 17L, 65L})
    for (const long m : {1L, 7L, 11L, 12L, 13L, 65L})
      for (const long n : {1L, 7L, 31L, 32L, 33L, 65L, 66L}) transposed_gemm_of(c, rows, m, n);
  // All voxels of a 64^3 grid with the same sign, so that rounding errors grow with the number of terms.
  transposed_gemm_of(c, 262144, 5, 9, 0, 2e-6);
}

}  // namespace

VSPLAT_CASES(gemm, {"gemm", gemm_all}, {"gemm_matrix", gemm_matrix_all}, {"gemm_pairs", gemm_pairs_all},
             {"transposed_gemm", transposed_gemm_all})

}  // namespace vsplat::selftest
