#include "model/ops/fit/muon.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/ops/fit/adamw.h"
#include "runtime/fail.h"
#include "runtime/gemm.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Applies x p(x^T x), with p(s) = a + b s + c s^2, five times to a matrix of norm 1. The polynomial is steepest at 0,
// so that small singular values grow quickly.
constexpr int kIterations = 5;
constexpr float kA = 3.4445f, kB = -4.7750f, kC = 2.0315f;

// x [tall, narrow] times p [narrow, narrow].
Tensor product(Context& ctx, const Tensor& x, const Tensor& p) {
  const long k = p.dim(0);
  const PackedMatrix packed = pack_matrix(ctx, p, k, k, k, 1, "muon.polynomial");
  Gemm g;
  g.a.x0 = x;
  g.b = &packed;
  g.out = ctx.tensor(x.shape(), Type::f32, "muon.x");
  g.name = "muon.product";
  gemm(ctx, g);
  return g.out;
}

Tensor square(Context& ctx, const Tensor& x) {
  const long k = x.dim(1);
  const Tensor out = ctx.tensor({k, k}, Type::f32, "muon.square");
  transposed_gemm(ctx, {x, x, out, false, "muon.square"});
  return out;
}

Tensor orthogonal(Context& ctx, Tensor x) {
  const long k = x.dim(1);
  const auto elements = static_cast<double>(k * k);
  for (int i = 0; i < kIterations; ++i) {
    const Tensor s = square(ctx, x), s2 = square(ctx, s);  // symmetric: s^T s
    const Tensor p = ctx.tensor({k, k}, Type::f32, "muon.polynomial");
    ctx.launch({"muon", "muon_polynomial", ""}, items(k * k), {4 * elements, 12 * elements}, s, s2, written(p), k, kA,
               kB, kC);
    x = product(ctx, x, p);
  }
  return x;
}

}  // namespace

void muon_step(Context& ctx, const MuonStep& a) {
  if (a.param.type() != Type::f32 || a.param.rank() < 2 || a.param.count() > std::numeric_limits<int>::max() - 64)
    fail(Status::internal, "param: {} found, an f32 matrix of fewer than 2^31 elements expected", a.param.describe());
  Dims().like("m", a.m, "param", a.param).like("grad", a.grad, "param", a.param).bind_optional("clip", a.clip, {"2"});
  const long count = a.param.count();
  if (count == 0) return;
  const long n = a.param.dim(0), k = count / n, turned = n < k ? 1 : 0;
  const auto elements = static_cast<double>(count);
  const Tensor x = ctx.tensor({std::max(n, k), std::min(n, k)}, Type::f32, "muon.x");
  ctx.launch({"muon", "muon_momentum", ""}, items(count), {5 * elements, 16 * elements}, a.grad, a.clip, written(a.m),
             written(x), n, k, turned, static_cast<float>(a.momentum), static_cast<float>(1 - a.momentum));
  const Tensor norm = ctx.tensor({2}, Type::f32, "muon.norm");
  gradient_clip(ctx, {{x}, 1, 1, norm});
  ctx.launch({"muon", "muon_normalize", ""}, items(count), {elements, 8 * elements}, written(x), norm, count);
  const double rate = a.lr * 0.2 * std::sqrt(static_cast<double>(std::max(n, k)));
  ctx.launch({"muon", "muon_update", ""}, items(count), {4 * elements, 12 * elements}, written(a.param),
             orthogonal(ctx, x), n, k, turned, static_cast<float>(a.lr * a.weight_decay), static_cast<float>(rate));
}

}  // namespace vsplat
