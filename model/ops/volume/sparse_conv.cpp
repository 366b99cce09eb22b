#include "model/ops/volume/sparse_conv.h"

#include <algorithm>

#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

struct Sizes {
  long p, taps, cin, cout;
};

Sizes check(const SubmanifoldBackward& a) {
  Dims d;
  d.bind("w", a.w, {"Cout", "k", "k", "k", "Cin"}).bind("dw", a.dw, {"Cout", "k", "k", "k", "Cin"});
  d.bind("dbias", a.dbias, {"Cout"}).bind("dy", a.dy, {"P", "Cout"}).bind_optional("dx", a.dx, {"P", "Cin"});
  d.bind("x0", a.in.x0, {"P", "C0"}).bind_optional("x1", a.in.x1, {"P", "C1"});
  const long k = d["k"], taps = k * k * k, channels = a.in.x0.dim(1) + (a.in.x1 ? a.in.x1.dim(1) : 0);
  if (channels != d["Cin"])
    fail(Status::internal, "{}: inputs of {} channels, weights {}", a.name, channels, a.w.describe());
  d.set("taps", taps);
  if (a.in.map || taps != 1) d.bind("map", a.in.map, {"P", "taps"}, Type::i32);
  if (a.back) {
    d.set("rows", 2 * d["P"]).bind("back", a.back, {"P", "taps"}, Type::i32);
    d.bind("back_dy", a.back_dy, {"rows", "Cout"});
  }
  return {d["P"], taps, d["Cin"], d["Cout"]};
}

// The path from row i through tap k to row j leads back from j through the opposite tap to i: dx is a convolution of dy
// with mirrored weights, over the same map.
void by_inputs(Context& ctx, const SubmanifoldBackward& a, const Sizes& s) {
  Tensor mirrored = a.w;
  if (s.taps > 1) {
    mirrored = ctx.tensor({s.taps, s.cout, s.cin}, Type::f32, "mirrored weights");
    ctx.launch({"sparse_conv", "submanifold_backward_mirror", ""}, items(a.w.count()),
               {0, 8.0 * static_cast<double>(a.w.count())}, a.w, written(mirrored), s.cout, s.taps, s.cin);
  }
  const PackedMatrix packed =
      pack_matrix(ctx, mirrored, s.taps * s.cout, s.cin, s.cin, 1, std::string(a.name) + " mirrored");
  Gemm g;
  g.a.x0 = a.back ? a.back_dy : a.dy;
  g.a.map = a.back ? a.back : a.in.map;
  g.b = &packed;
  if (a.add) g.residual = a.dx;
  g.out = a.dx;
  g.name = a.name;
  gemm(ctx, g);
}

// The sum over rows of dy's row and the gathered one, some rows at a time: their gathered rows are 27 times the inputs.
void by_weights(Context& ctx, const SubmanifoldBackward& a, const Sizes& s) {
  constexpr long sum_rows = 1024;  // transposed_gemm() adds up sums of so many
  const long k = s.taps * s.cin;
  const long floats = ctx.flavour() == Flavour::cpu ? 1L << 20 : 16L << 20;  // a GPU makes many sums at once
  const long most = std::min(s.p, std::max(1L, floats / (sum_rows * k)) * sum_rows);
  RowSource in = a.in;
  if (in.map && (in.scale || in.silu)) {
    const Tensor composed = ctx.tensor({s.p, s.cin}, Type::f32, "composed rows");
    in.map = {};
    compose_rows(ctx, in, composed);
    in = {};
    in.x0 = composed;
    in.map = a.in.map;
  }
  RowSource dy;
  dy.x0 = a.dy;
  const Tensor dw = a.dw.reshaped({s.cout, k}), gathered = ctx.tensor({most, k}, Type::f32, "gathered rows");
  const Tensor some = most < s.p ? ctx.tensor({most, s.cout}, Type::f32, "some rows") : Tensor();
  for (long row = 0; row < s.p; row += most) {
    const long rows = std::min(most, s.p - row);
    compose_rows(ctx, in, gathered.first(rows), row);
    if (some) compose_rows(ctx, dy, some.first(rows), row);
    transposed_gemm(ctx, {some ? some.first(rows) : a.dy, gathered.first(rows), dw, true, a.name});
  }
}

}  // namespace

ConvWeights pack_submanifold(Context& ctx, const float* w, const float* bias, long cout, long taps, long cin,
                             const std::string& what) {
  ConvWeights out;
  out.cin = cin, out.cout = cout;
  out.w = pack_matrix(ctx, w, taps * cin, cout, 1, taps * cin, what);
  if (bias) out.bias = ctx.upload({cout}, bias, Type::f32, what + " bias");
  return out;
}

ConvWeights pack_submanifold(Context& ctx, const Tensor& w, const Tensor& bias, const std::string& what) {
  const long cout = w.dim(0), cin = w.shape().back(), k = w.count() / cout;
  return {pack_matrix(ctx, w, k, cout, 1, k, what), bias, cin, cout};
}

void submanifold_forward(Context& ctx, const SubmanifoldForward& a) {
  if (!a.weights) fail(Status::internal, "{}: no weights", a.name);
  Gemm g;
  g.a = a.in;
  g.b = &a.weights->w;
  g.bias = a.weights->bias;
  g.residual = a.residual;
  g.out = a.out;
  g.name = a.name;
  gemm(ctx, g);
}

void submanifold_backward(Context& ctx, const SubmanifoldBackward& a) {
  const Sizes s = check(a);
  if (s.p * s.cin * s.cout == 0) return;
  column_sum(ctx, {a.dy, a.dbias, true});
  by_weights(ctx, a, s);
  if (a.dx) by_inputs(ctx, a, s);
}

}  // namespace vsplat
