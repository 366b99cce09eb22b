#include "model/network/layers.h"

#include "model/ops/activation.h"
#include "model/ops/groupnorm.h"
#include "runtime/column_sum.h"
#include "runtime/compose_rows.h"

namespace vsplat {
namespace {

long count_of(const RowSource& a) { return a.map ? a.map.dim(0) : a.x0.rows(); }

}  // namespace

RowSource rows_of(const Tensor& x, bool silu) {
  RowSource out;
  out.x0 = x;
  out.silu = silu;
  return out;
}

Tensor linear_forward(Context& ctx, const Linear& layer, const RowSource& in, const char* name, Activation activation) {
  Gemm g;
  g.a = in;
  g.b = &layer.w;
  g.bias = layer.bias;
  g.activation = activation;
  g.out = ctx.tensor({count_of(in), layer.w.n}, Type::f32, name);
  g.name = name;
  gemm(ctx, g);
  return g.out;
}

void linear_backward(Context& ctx, const Linear& layer, const LinearBackward& b) {
  const long out = layer.w.n, in = layer.w.k, rows = count_of(b.in);
  {
    Tensor x = b.in.x0;
    if (b.in.x1 || b.in.scale || b.in.silu) {
      x = ctx.tensor({rows, in}, Type::f32, "composed rows");
      compose_rows(ctx, b.in, x);
    }
    transposed_gemm(ctx, {b.dy, x, layer.dweight, true, b.name});
  }
  column_sum(ctx, {b.dy, layer.dbias, true});

  long first = 0;
  for (const Tensor& dx : {b.dx0, b.dx1}) {
    if (!dx) continue;
    const long width = dx.shape().back();
    const PackedMatrix w = pack_matrix(ctx, layer.plain, out, width, in, 1, b.name, first);
    first += width;
    Gemm g;
    g.a.x0 = b.dy;
    g.b = &w;
    g.residual = b.add ? dx : Tensor();
    g.out = dx;
    g.name = b.name;
    gemm(ctx, g);
  }
}

RowSource norm_silu_forward(Context& ctx, const GroupNorm& norm, const Tensor& x0, const Tensor& x1, NormSaved* saved) {
  const Shape channels{norm.gamma.dim(0)};
  GroupNormForward f;
  f.x0 = x0;
  f.x1 = x1;
  f.gamma = norm.gamma;
  f.beta = norm.beta;
  f.groups = norm.groups;
  f.scale = ctx.tensor(channels, Type::f32, "groupnorm.scale");
  f.shift = ctx.tensor(channels, Type::f32, "groupnorm.shift");
  if (saved) {
    f.mean = ctx.tensor(channels, Type::f32, "groupnorm.mean");
    f.rstd = ctx.tensor(channels, Type::f32, "groupnorm.rstd");
  }
  groupnorm_forward(ctx, f);
  RowSource out;
  out.x0 = x0;
  out.x1 = x1;
  out.scale = f.scale;
  out.shift = f.shift;
  out.silu = true;
  if (saved) *saved = {out, f.mean, f.rstd};
  return out;
}

void norm_silu_backward(Context& ctx, const GroupNorm& norm, const NormSaved& saved, const Tensor& dy,
                        const Tensor& dx0, const Tensor& dx1, bool add) {
  GroupNormBackward b;
  b.x0 = saved.rows.x0;
  b.x1 = saved.rows.x1;
  b.gamma = norm.gamma;
  b.scale = saved.rows.scale;
  b.shift = saved.rows.shift;
  b.mean = saved.mean;
  b.rstd = saved.rstd;
  b.groups = norm.groups;
  b.dy = dy;
  b.dx0 = dx0;
  b.dx1 = dx1;
  b.add = add;
  b.dgamma = norm.dgamma;
  b.dbeta = norm.dbeta;
  groupnorm_backward(ctx, b);
}

Tensor mlp3_forward(Context& ctx, const Mlp3& mlp, const Tensor& x, const char* name, Mlp3Saved* saved) {
  RowSource in = rows_of(x);
  if (saved) {
    const Tensor h1 = linear_forward(ctx, mlp.first, in, name),
                 h2 = linear_forward(ctx, mlp.second, rows_of(h1, true), name);
    *saved = {x, h1, h2};
    return linear_forward(ctx, mlp.third, rows_of(h2, true), name);
  }
  in.x0 = linear_forward(ctx, mlp.first, in, name, Activation::silu);
  in.x0 = linear_forward(ctx, mlp.second, in, name, Activation::silu);
  return linear_forward(ctx, mlp.third, in, name);
}

void mlp3_backward(Context& ctx, const Mlp3& mlp, const Mlp3Saved& saved, const Tensor& dy, const Tensor& dx, bool add,
                   const char* name) {
  const Tensor d2 = ctx.tensor(saved.h2.shape(), Type::f32, "mlp gradient");
  linear_backward(ctx, mlp.third, {rows_of(saved.h2, true), dy, d2, {}, false, name});
  activation_backward(ctx, {saved.h2, Activation::silu, d2, d2});
  const Tensor d1 = ctx.tensor(saved.h1.shape(), Type::f32, "mlp gradient");
  linear_backward(ctx, mlp.second, {rows_of(saved.h1, true), d2, d1, {}, false, name});
  activation_backward(ctx, {saved.h1, Activation::silu, d1, d1});
  linear_backward(ctx, mlp.first, {rows_of(saved.x), d1, dx, {}, add, name});
}

}  // namespace vsplat
