#include "model/networks/lara/decoder.h"

#include <algorithm>

#include "model/ops/dense/activation.h"
#include "model/ops/dense/cross_attention.h"
#include "model/ops/dense/gather.h"
#include "model/ops/networks/decode.h"
#include "model/ops/networks/view_maps.h"
#include "model/ops/volume/sample_points.h"
#include "runtime/compose_rows.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr float kEps = 1e-5f;

CoarseKind kind_of(const LaraConfig& c) { return {c.primitives, 0.25 * c.grid() / c.offset_cells, true}; }

// A copy of rows [first, first + n).
Tensor rows_from(Context& ctx, const Tensor& x, long first, long n) {
  const Tensor out = ctx.tensor({n, x.dim(1)}, Type::f32, "decoder.rows");
  compose_rows(ctx, rows_of(x), out, first);
  return out;
}

}  // namespace

LaraCoarseDecoder::LaraCoarseDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

DeviceGaussians LaraCoarseDecoder::forward(Context& ctx, const Tensor& volume, Saved* saved) const {
  Tensor raw;
  {
    const Stage stage(ctx, "heads");
    raw = relu_mlp_forward(ctx, layers_.mlp, volume, "mlp_coarse", saved ? &saved->mlp : nullptr);
  }
  if (saved) saved->raw = raw;
  const Stage stage(ctx, "decode");
  const DeviceGaussians out =
      make_gaussians(ctx, config_.most_primitives(), config_.sh_count(), "coarse", config_.scales());
  decode_coarse_forward(ctx, {raw, config_.grid(), out, kind_of(config_)});
  return out;
}

void LaraCoarseDecoder::backward(Context& ctx, const Saved& saved, const GaussianGradients& dgaussians,
                                 const Tensor& dvolume) const {
  const Stage stage(ctx, "heads");
  const Tensor draw = ctx.tensor(saved.raw.shape(), Type::f32, "mlp_coarse gradient");
  {
    const Stage decode(ctx, "decode");
    decode_coarse_backward(ctx, {saved.raw, config_.grid(), dgaussians, draw, kind_of(config_)});
  }
  relu_mlp_backward(ctx, layers_.mlp, saved.mlp, draw, dvolume, true, "mlp_coarse");
}

LaraFineDecoder::LaraFineDecoder(Context& ctx, const LaraConfig& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

LaraFineDecoder::Block LaraFineDecoder::run(Context& ctx, const Input& in, long first, long n, bool keep) const {
  const long c = config_.out_ch, views = in.cameras.count(), heads = config_.fine_heads;
  const auto rows = [&](long count, long width, const char* what) {
    return ctx.tensor({count, width}, Type::f32, what);
  };
  Block b;
  b.first = first, b.n = n;
  b.index = ctx.upload({n}, in.kept.data() + first, Type::i32, "decoder.index");
  b.points = rows_from(ctx, in.means, first, n);
  b.samples = ctx.tensor({n, views, kViewMap}, Type::f32, "fine.samples");
  sample_points_forward(ctx, {in.maps, b.points, &in.cameras, config_.sample_half_pixel, b.samples});
  b.feature = rows(n, c, "fine.feature");
  gather_forward(ctx, {in.volume, b.index, b.feature, 0, config_.primitives});
  const LaraAttention<WeightLoader>& attention = layers_.attention;
  const RowSource seen = rows_of(b.samples.reshaped({n * views, kViewMap}));
  b.q = linear_forward(ctx, attention.q, rows_of(normed_forward(ctx, layers_.norm, b.feature, kEps, "fine.normed")),
                       "cross_att.q");
  b.k = linear_forward(ctx, attention.k, seen, "cross_att.k");
  b.v = linear_forward(ctx, attention.v, seen, "cross_att.v");
  b.attended = rows(n, c, "fine.attended");
  if (keep) b.stats = rows(n, heads, "fine.stats");
  cross_attention_forward(ctx, {b.q, b.k, b.v, heads, {{}, {}, 1, views}, b.attended, b.stats});
  b.mixed = linear_forward(ctx, attention.out, rows_of(b.attended), "cross_att.out");
  b.hidden = linear_forward(ctx, layers_.mlp[0], rows_of(b.mixed), "mlp_fine.0", Activation::relu);
  return b;
}

Tensor LaraFineDecoder::samples(Context& ctx, const Input& in) const {
  const Tensor out =
      ctx.tensor({static_cast<long>(in.kept.size()), in.cameras.count(), kViewMap}, Type::f32, "fine.samples of all");
  sample_points_forward(ctx, {in.maps, in.means, &in.cameras, config_.sample_half_pixel, out});
  return out;
}

Tensor LaraFineDecoder::forward(Context& ctx, const Input& in) const {
  const Stage stage(ctx, "refinement");
  const long p = static_cast<long>(in.kept.size());
  Dims().set("P", p).bind("means", in.means, {"P", "3"});
  const Tensor out = ctx.tensor({p, layers_.mlp[1].w.n}, Type::f32, "fine.output");
  for (long first = 0; first < p; first += in.block) {
    const Block b = run(ctx, in, first, std::min(in.block, p - first), false);
    Gemm g;
    g.a = rows_of(b.hidden);
    g.b = &layers_.mlp[1].w;
    g.bias = layers_.mlp[1].bias;
    g.out = out;
    g.rows = b.n;
    g.out_row0 = first;
    g.name = "mlp_fine.2";
    gemm(ctx, g);
  }
  return out;
}

void LaraFineDecoder::backward(Context& ctx, const Input& in, const Tensor& dout, const Gradients& out) const {
  const Stage stage(ctx, "refinement");
  const long p = static_cast<long>(in.kept.size());
  for (long first = 0; first < p; first += in.block)
    backward(ctx, in, run(ctx, in, first, std::min(in.block, p - first), true), dout, out);
}

void LaraFineDecoder::backward(Context& ctx, const Input& in, const Block& b, const Tensor& dout,
                               const Gradients& out) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "fine gradient"); };
  const LaraAttention<WeightLoader>& attention = layers_.attention;
  const long views = in.cameras.count();
  const Tensor dmixed = like(b.mixed);
  {
    const Tensor dhidden = like(b.hidden);
    linear_backward(ctx, layers_.mlp[1],
                    {rows_of(b.hidden), rows_from(ctx, dout, b.first, b.n), dhidden, {}, false, "mlp_fine.2"});
    activation_backward(ctx, {b.hidden, Activation::relu, dhidden, dhidden});
    linear_backward(ctx, layers_.mlp[0], {rows_of(b.mixed), dhidden, dmixed, {}, false, "mlp_fine.0"});
  }
  const Tensor dattended = like(b.attended), dq = like(b.q), dk = like(b.k), dv = like(b.v);
  linear_backward(ctx, attention.out, {rows_of(b.attended), dmixed, dattended, {}, false, "cross_att.out"});
  cross_attention_backward(
      ctx, {b.q, b.k, b.v, config_.fine_heads, {{}, {}, 1, views}, b.attended, b.stats, dattended, dq, dk, dv});
  const Tensor dsamples = like(b.samples), by_row = dsamples.reshaped({b.n * views, kViewMap});
  const RowSource seen = rows_of(b.samples.reshaped(by_row.shape()));
  linear_backward(ctx, attention.k, {seen, dk, by_row, {}, false, "cross_att.k"});
  linear_backward(ctx, attention.v, {seen, dv, by_row, {}, true, "cross_att.v"});
  const Tensor dfeature = like(b.feature), dnormed = like(b.feature);
  const Tensor normed = normed_forward(ctx, layers_.norm, b.feature, kEps, "fine.normed");
  linear_backward(ctx, attention.q, {rows_of(normed), dq, dnormed, {}, false, "cross_att.q"});
  normed_backward(ctx, layers_.norm, b.feature, kEps, dnormed, dfeature, false);
  gather_backward(ctx, {dfeature, b.index, out.volume, 0, config_.primitives});
  if (!out.means && !out.maps) return;
  const Tensor dpoints = like(b.points);
  ctx.fill_zero(dpoints);
  sample_points_backward(
      ctx, {{in.maps, b.points, &in.cameras, config_.sample_half_pixel, {}}, dsamples, dpoints, out.maps});
  if (out.means) gather_backward(ctx, {dpoints, b.index, out.means});
}

}  // namespace vsplat
