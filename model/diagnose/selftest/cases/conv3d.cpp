#include <array>
#include <optional>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/pairs.h"
#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::selftest {
namespace {

// Operands have 8 bits, and the transforms add up as many as 36 inputs. The root mean square of the errors is 1.2 % of
// that of the results, of outputs and of gradients by weights alike; the latter's 27 Cin Cout numbers are more.
constexpr double kPairsTolerance = 2e-2, kPairsWeightsTolerance = 3e-2;

const float* or_null(const std::vector<float>& v) { return v.empty() ? nullptr : v.data(); }

// `pairs`: of rounded operands, in the cpu flavour.
void conv3d_of(Checks& c, const ConvTry& t, ConvMethod method, bool pairs = false) {
  std::optional<AlwaysPairs> always;
  if (pairs) always.emplace();
  // Winograd's transforms triple the rounding of float32 sums.
  const double tolerance = pairs ? kPairsTolerance : method == ConvMethod::winograd ? 2e-5 : 1e-5;
  const ref::ConvCase want = make_conv_case(t);
  const long cin = t.cin + t.c1, rows = want.in.rows;
  const auto dy = random_floats(size_of(rows, t.cout), 73);
  // Zeros under the coarse tolerance of pairs, which is relative to the largest sum.
  const auto before = pairs ? std::vector<float>(want.w.size()) : random_floats(want.w.size(), 74);
  const auto forward = [&](const ConvWeights& weights, const char* what) {
    Conv3dForward f;
    f.in = upload_rows(c.ctx, want.in), f.x = t.size[0], f.y = t.size[1], f.z = t.size[2], f.weights = &weights;
    if (t.residual) f.residual = c.up({rows, t.cout}, want.residual);
    f.out = c.gap({rows, t.cout});
    conv3d_forward(c.ctx, f);
    c.close(
        what, f.out, [&] { return want.all(); }, tolerance);
    if (!c.all || !t.residual) return;
    const auto got = c.ctx.read<float>(f.out);
    f.out = f.residual;  // which may be the output
    conv3d_forward(c.ctx, f);
    c.equal(what, f.out, got);
  };
  forward(pack_conv3d(c.ctx, want.w.data(), or_null(want.bias), t.cout, cin, "weight", method), "forward");
  const Tensor w = c.up({t.cout, cin, 3, 3, 3}, want.w);
  const Tensor bias = t.bias ? c.up({t.cout}, want.bias) : Tensor();
  const ConvWeights packed = pack_conv3d(c.ctx, w, bias, "weight", method);
  const Tensor on_host = pack_conv3d(c.ctx, want.w.data(), nullptr, t.cout, cin, "weight", method).w.data;
  if (method == ConvMethod::direct)
    c.equal("packed on the device", packed.w.data, c.ctx.read<float>(on_host));
  else if (!pairs)  // computed in float rather than double; a rounding to pairs may go the other way
    c.close("packed on the device", packed.w.data, c.ctx.read<float>(on_host), 1e-6);
  c.keep();
  forward(packed, "forward, packed on the device");
  const ref::ConvGradient by = ref::conv_backward(want, dy);
  // By weights Winograd's method is the cpu flavour's.
  const ConvMethod by_weights = c.ctx.flavour() == Flavour::cpu ? method : ConvMethod::direct;
  Conv3dBackwardWeights g;
  g.in = upload_rows(c.ctx, want.in), g.x = t.size[0], g.y = t.size[1], g.z = t.size[2], g.method = by_weights;
  g.dy = c.up({rows, t.cout}, dy), g.dw = c.up({t.cout, cin, 3, 3, 3}, before), g.dbias = c.zeros({t.cout});
  conv3d_backward_weights(c.ctx, g);
  auto sums = by.dw;
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
  c.close("backward, dw", g.dw, sums, pairs ? kPairsWeightsTolerance : tolerance);
  c.close("backward, dbias", g.dbias, by.dbias, 1e-5);
  if (c.all) {
    Conv3dBackwardWeights alone = g;
    alone.dw = c.up(g.dw.shape(), before), alone.dbias = Tensor();
    conv3d_backward_weights(c.ctx, alone);
    c.equal("backward, dw without dbias", alone.dw, c.ctx.read<float>(g.dw));
  }
  if (rows == 0) return;
  Conv3dBackwardInputs b;
  b.w = w, b.x = t.size[0], b.y = t.size[1], b.z = t.size[2], b.method = method;
  b.dy = g.dy, b.dx = c.gap({rows, cin});
  conv3d_backward_inputs(c.ctx, b);
  c.close("backward, dx", b.dx, by.dx, tolerance);
}

void conv3d_by(Checks& c, ConvMethod method) {
  for (const ConvTry& t : c.some({ConvTry{{1, 1, 1}, 1, 1},
                                  {{3, 2, 11}, 3, 5},
                                  {{2, 3, 12}, 7, 31},
                                  {{1, 5, 13}, 16, 32},
                                  {{3, 3, 5}, 17, 33},
                                  {{7, 4, 2}, 33, 16},
                                  {{5, 5, 4}, 12, 65}},
                                 {{{3, 5, 13}, 11, 31},
                                  {{4, 1, 12}, 13, 33},
                                  {{5, 9, 65}, 5, 6},
                                  {{5, 9, 65}, 65, 67},
                                  {{13, 19, 17}, 3, 5},
                                  {{2, 3, 1100}, 2, 1},
                                  {{0, 3, 4}, 5, 6},
                                  {{12, 12, 16}, 9, 10}}))
    conv3d_of(c, t, method);
  ConvTry all{{4, 3, 13}, 16, 20, 5};
  all.affine = all.silu = all.residual = true;
  conv3d_of(c, all, method);
  if (!c.all) return;
  conv3d_of(c, {{2L * c.ctx.device().compute_units + 1, 8, 16}, 3, 66}, method);
  for (const long z : {1, 2, 4, 5, 10, 11, 12, 13, 24, 25}) conv3d_of(c, {{3, 2, z}, 3, 5}, method);
  for (const long x : {1, 2, 3, 7})
    for (const long y : {1, 2, 5}) conv3d_of(c, {{x, y, 4}, 3, 5}, method);
  for (const long cin : {1, 7, 16, 17, 33})
    for (const long cout : {1, 15, 16, 31, 32, 33, 34, 65}) conv3d_of(c, {{3, 3, 5}, cin, cout}, method);
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true})
        for (const bool residual : {false, true})
          conv3d_of(c, {{4, 3, 13}, 16, 20, c1, affine, silu, !residual, residual}, method);
}

void conv3d_all(Checks& c) {
  conv3d_by(c, ConvMethod::direct);
  // Enough tiles of 128 x 128 for the gpu flavour to take those.
  if (c.ctx.flavour() == Flavour::gpu)
    conv3d_of(c, {{2L * c.ctx.device().compute_units + 1, 8, 16}, 2, 66}, ConvMethod::direct);
}

void conv3d_winograd_all(Checks& c) {
  if (!c.ctx.switched_off().winograd) conv3d_by(c, ConvMethod::winograd);
}

void conv3d_pairs_all(Checks& c) {
  if (!multiplies_pairs(c) || c.ctx.switched_off().winograd) return;
  for (const ConvTry& t :
       c.some({ConvTry{{1, 1, 1}, 1, 1},
               {{3, 2, 11}, 3, 5},
               {{2, 3, 12}, 7, 31},
               {{1, 5, 13}, 16, 32},
               {{3, 3, 5}, 17, 33},
               {{5, 5, 4}, 34, 65}},
              {{{4, 1, 12}, 15, 33}, {{5, 9, 25}, 31, 6}, {{5, 9, 5}, 65, 67}, {{2, 3, 1100}, 2, 1}}))
    conv3d_of(c, t, ConvMethod::winograd, true);
  // So many tiles that a work-item has several, the last one fewer.
  const long some = 8L * std::min(c.ctx.device().compute_units, 16) + 1;
  if (c.all) conv3d_of(c, {{some, 17, 5}, 16, 33}, ConvMethod::winograd, true);
  for (const long c1 : {5L, 16L}) {
    ConvTry all{{4, 3, 13}, 16, 20, c1};
    all.affine = all.silu = all.residual = true;
    conv3d_of(c, all, ConvMethod::winograd, true);
  }
  ConvTry odd{{4, 3, 13}, 13, 20, 6};
  odd.silu = true;
  conv3d_of(c, odd, ConvMethod::winograd, true);
}

void conv3d_down_of(Checks& c, const std::array<long, 3>& size, long cin, long cout) {
  ConvTry t{size, cin, cout};
  t.affine = t.silu = cin > 1;
  const ref::ConvCase want = make_conv_case(t, 2);
  const auto out = want.out_size();
  const long rows = out[0] * out[1] * out[2];
  const Tensor w = c.up({cout, cin, 2, 2, 2}, want.w), bias = c.up({cout}, want.bias);
  Conv3dDownForward f;
  f.in = upload_rows(c.ctx, want.in), f.in.map = conv3d_down_map(c.ctx, size[0], size[1], size[2]);
  for (const bool on_host : {true, false}) {
    const ConvWeights weights = on_host ? pack_conv3d_down(c.ctx, want.w.data(), want.bias.data(), cout, cin, "weight")
                                        : pack_conv3d_down(c.ctx, w, bias, "weight");
    f.weights = &weights, f.out = c.gap({rows, cout});
    conv3d_down_forward(c.ctx, f);
    c.close(
        "forward", f.out, [&] { return want.all(); }, 1e-5);
  }
  const auto dy = random_floats(size_of(rows, cout), 75), dx = random_floats(size_of(want.in.rows, cin), 72, 1, 2),
             dw = random_floats(want.w.size(), 73, 1, 2), dbias = random_floats(size_of(cout), 74, 1, 2);
  const ref::ConvGradient by = ref::conv_backward(want, dy);
  const Conv3dDownBackward g{
      f.in, w, c.up({rows, cout}, dy), c.up({want.in.rows, cin}, dx), c.up(w.shape(), dw), c.up({cout}, dbias)};
  conv3d_down_backward(c.ctx, g);
  c.close("backward, dx", g.dx, plus(by.dx, dx), 1e-5);
  c.close("backward, dw", g.dw, plus(by.dw, dw), 1e-5);
  c.close("backward, dbias", g.dbias, plus(by.dbias, dbias), 1e-5);
}

void conv3d_down_all(Checks& c) {
  for (const auto& size : c.some({std::array<long, 3>{2, 2, 2}, {4, 6, 8}, {5, 3, 7}}, {{1, 4, 4}, {16, 12, 26}}))
    for (const auto& [cin, cout] : c.some({std::pair{17L, 33L}}, {{1L, 1L}, {3L, 7L}, {1L, 33L}}))
      conv3d_down_of(c, size, cin, cout);
}

}  // namespace

VSPLAT_CASES(conv3d, {"conv3d", conv3d_all}, {"conv3d_winograd", conv3d_winograd_all},
             {"conv3d_pairs", conv3d_pairs_all}, {"conv3d_down", conv3d_down_all})

}  // namespace vsplat::selftest
