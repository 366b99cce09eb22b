#include "model/networks/layers/layers.h"

#include "model/ops/dense/activation.h"
#include "model/ops/dense/groupnorm.h"
#include "model/ops/dense/layer_scale.h"
#include "model/ops/dense/layernorm.h"
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
  if (layer.dbias) column_sum(ctx, {b.dy, layer.dbias, true});

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

FoldedGradients::FoldedGradients(Context& ctx, const ScaledLinear& layer) : layer_(layer), linear_(layer.folded) {
  if (!layer.scale) return;
  linear_.dweight = ctx.tensor(layer.weight.shape(), Type::f32, "folded weight's gradient");
  linear_.dbias = ctx.tensor(layer.bias.shape(), Type::f32, "folded bias's gradient");
  ctx.fill_zero(linear_.dweight);
  ctx.fill_zero(linear_.dbias);
}

void FoldedGradients::add(Context& ctx) const {
  if (!layer_.scale) return;
  layer_scale_backward(ctx, {layer_.weight, layer_.bias, layer_.scale, linear_.dweight, linear_.dbias, layer_.dweight,
                             layer_.dbias, layer_.dscale});
}

Tensor flat(const Tensor& x) { return x.reshaped({x.count() / x.shape().back(), x.shape().back()}); }

void add_linear(Context& ctx, const Linear& linear, const Tensor& in, const Tensor& x, const Tensor& out,
                const char* name) {
  Gemm g;
  g.a.x0 = in;
  g.b = &linear.w;
  g.bias = linear.bias;
  g.residual = flat(x);
  g.out = flat(out);
  g.name = name;
  gemm(ctx, g);
}

Tensor normed_forward(Context& ctx, const LayerNorm& norm, const Tensor& x, float eps, const char* what) {
  const Tensor out = ctx.tensor(flat(x).shape(), Type::f32, what);
  layernorm_forward(ctx, {flat(x), norm.gamma, norm.beta, eps, out});
  return out;
}

void normed_backward(Context& ctx, const LayerNorm& norm, const Tensor& x, float eps, const Tensor& dy,
                     const Tensor& dx, bool add) {
  layernorm_backward(ctx, {flat(x), norm.gamma, eps, flat(dy), flat(dx), norm.dgamma, norm.dbeta, add});
}

void gelu_mlp_forward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& out, Tensor* kept) {
  Tensor hidden = linear_forward(ctx, mlp.fc1, rows_of(normed_forward(ctx, mlp.norm, x, mlp.eps, "mlp.normed")),
                                 "mlp.fc1", kept ? Activation::none : mlp.activation);
  if (kept) {
    *kept = hidden;
    hidden = ctx.tensor(hidden.shape(), Type::f32, "mlp.hidden");
    activation_forward(ctx, {*kept, mlp.activation, hidden});
  }
  add_linear(ctx, mlp.fc2, hidden, x, out, "mlp.fc2");
}

void gelu_mlp_backward(Context& ctx, const GeluMlp& mlp, const Tensor& x, const Tensor& hidden, const Tensor& dx) {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "mlp gradient"); };
  const Tensor dnormed = like(flat(dx)), dhidden = like(hidden);
  {
    const Tensor active = like(hidden);
    activation_forward(ctx, {hidden, mlp.activation, active});
    linear_backward(ctx, mlp.fc2, {rows_of(active), flat(dx), dhidden, {}, false, "mlp.fc2"});
  }
  activation_backward(ctx, {hidden, mlp.activation, dhidden, dhidden});
  const Tensor normed = normed_forward(ctx, mlp.norm, x, mlp.eps, "mlp.normed");
  linear_backward(ctx, mlp.fc1, {rows_of(normed), dhidden, dnormed, {}, false, "mlp.fc1"});
  normed_backward(ctx, mlp.norm, x, mlp.eps, dnormed, dx);
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

Tensor volume_conv_forward(Context& ctx, const Conv& conv, const RowSource& in, long edge, const char* name,
                           const Tensor& residual, const Tensor& out) {
  Conv3dForward c;
  c.in = in;
  c.x = c.y = c.z = edge;
  c.weights = &conv.w;
  c.residual = residual;
  c.out = out ? out : ctx.tensor({edge * edge * edge, conv.w.cout}, Type::f32, name);
  c.name = name;
  conv3d_forward(ctx, c);
  return c.out;
}

Tensor volume_conv_backward(Context& ctx, const Conv& conv, const RowSource& in, const Tensor& dy, long edge,
                            const char* name) {
  Conv3dBackwardWeights g;
  g.in = in;
  g.x = g.y = g.z = edge;
  g.dy = dy;
  g.dw = conv.dweight;
  g.dbias = conv.dbias;
  g.name = name;
  conv3d_backward_weights(ctx, g);
  Conv3dBackwardInputs i;
  i.w = conv.plain;
  i.x = i.y = i.z = edge;
  i.dy = dy;
  i.dx = ctx.tensor({edge * edge * edge, conv.w.cin}, Type::f32, name);
  i.name = name;
  conv3d_backward_inputs(ctx, i);
  return i.dx;
}

Tensor relu_mlp_forward(Context& ctx, const std::vector<Linear>& mlp, const Tensor& x, const char* name,
                        std::vector<Tensor>* saved) {
  Tensor at = x;
  for (std::size_t i = 0; i < mlp.size(); ++i) {
    if (saved) saved->push_back(at);
    at = linear_forward(ctx, mlp[i], rows_of(at), name, i + 1 < mlp.size() ? Activation::relu : Activation::none);
  }
  return at;
}

void relu_mlp_backward(Context& ctx, const std::vector<Linear>& mlp, const std::vector<Tensor>& saved, const Tensor& dy,
                       const Tensor& dx, bool add, const char* name) {
  Tensor d = dy;
  for (std::size_t i = mlp.size(); i-- > 0;) {
    const Tensor next = i == 0 ? dx : ctx.tensor(saved[i].shape(), Type::f32, "mlp gradient");
    linear_backward(ctx, mlp[i], {rows_of(saved[i]), d, next, {}, i == 0 && add, name});
    if (i > 0) activation_backward(ctx, {saved[i], Activation::relu, next, next});
    d = next;
  }
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
