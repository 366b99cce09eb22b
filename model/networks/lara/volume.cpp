#include "model/networks/lara/volume.h"

#include <utility>

#include "model/ops/dense/conv3d_up.h"
#include "model/ops/dense/transpose.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// PyTorch's default in the layers, and the published code's value after them.
constexpr float kEps = 1e-5f, kLastEps = 1e-6f;

// For each of cells^3 cells of an edge^3 grid, the rows of its voxels, `views` rows a voxel: [cells^3, ..].
Tensor rows_of_cells(Context& ctx, long edge, long views, long cells) {
  const long b = edge / cells;
  std::vector<int> rows;
  for (long cell = 0; cell < cells * cells * cells; ++cell)
    for (long voxel = 0; voxel < b * b * b; ++voxel) {
      const long x = cell / (cells * cells) * b + voxel / (b * b), y = cell / cells % cells * b + voxel / b % b,
                 z = cell % cells * b + voxel % b;
      for (long v = 0; v < views; ++v) rows.push_back(static_cast<int>(((x * edge + y) * edge + z) * views + v));
    }
  const long count = cells * cells * cells;
  return ctx.upload({count, static_cast<long>(rows.size()) / count}, rows, Type::i32, "volume.rows");
}

}  // namespace

AttentionGroups window_groups(Context& ctx, long volume, long lifted, long views, long cells) {
  AttentionGroups out;
  out.queries = rows_of_cells(ctx, volume, 1, cells);
  out.keys = rows_of_cells(ctx, lifted, views, cells);
  return out;
}

LaraVolume::LaraVolume(Context& ctx, const LaraConfig& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {
  const long c = config.volume_ch, n = config.voxels();
  start_ = ctx.tensor({n, c}, Type::f32, "volume.start");
  transpose(ctx, {layers_.start.value.reshaped({c, n}), start_});
  if (!layers_.start.gradient) layers_.start.value = {};  // used only once
}

std::vector<AttentionGroups> LaraVolume::all_groups(Context& ctx, long views) const {
  std::vector<AttentionGroups> out;
  for (const int cells : config_.windows)
    out.push_back(window_groups(ctx, config_.volume, config_.feature_volume, views, cells));
  return out;
}

// y = x + attention(norm1(x)), y = y + mlp(norm2(y)), then n + conv(n) with n = norm3(y): the residual is the
// normalised volume.
Tensor LaraVolume::forward(Context& ctx, const Layer& l, const Tensor& x, const RowSource& lifted,
                           const AttentionGroups& groups, LayerSaved* saved, const std::string& name,
                           const Tap& tap) const {
  const auto rows = [&](const char* what) { return ctx.tensor(x.shape(), Type::f32, what); };
  const Tensor middle = rows("volume.middle");
  Tensor hidden;
  {
    const Tensor q =
        linear_forward(ctx, l.attention.q, rows_of(normed_forward(ctx, l.norm1, x, kEps, "volume.normed")), "attn.q");
    const Tensor k = linear_forward(ctx, l.attention.k, lifted, "attn.k"),
                 v = linear_forward(ctx, l.attention.v, lifted, "attn.v");
    const Tensor attended = rows("volume.attended");
    const Tensor stats = saved ? ctx.tensor({x.dim(0), config_.heads}, Type::f32, "volume.stats") : Tensor();
    cross_attention_forward(ctx, {q, k, v, config_.heads, groups, attended, stats});
    add_linear(ctx, l.attention.out, attended, x, middle, "attn.out");
    if (saved) *saved = {x, q, k, v, attended, stats, middle, {}, {}};
  }
  if (tap) tap(name + "attention", middle);
  const Tensor after = saved ? rows("volume.after") : middle;
  gelu_mlp_forward(ctx, {l.norm2, l.fc1, l.fc2, kEps}, middle, after, saved ? &saved->hidden : nullptr);
  if (saved) saved->after = after;
  if (tap) tap(name + "mlp", after);
  const Tensor normed = normed_forward(ctx, l.norm3, after, kEps, "volume.normed");
  const Tensor out = volume_conv_forward(ctx, l.conv, rows_of(normed), config_.volume, "cnn", normed);
  if (tap) tap(name + "output", out);
  return out;
}

Tensor LaraVolume::forward(Context& ctx, const RowSource& lifted, long views, Saved* saved, const Tap& tap) const {
  const Stage stage(ctx, "volume");
  Dims()
      .set("r^3 V", config_.lifted_voxels() * views)
      .set("C", config_.vit_dim)
      .set("E", config_.view_ch)
      .bind("samples", lifted.x0, {"r^3 V", "C"})
      .bind("embedded", lifted.x1, {"r^3 V", "E"});
  const std::vector<AttentionGroups> groups = all_groups(ctx, views);
  if (saved) saved->lifted = lifted, saved->views = views;
  Tensor x = start_;
  for (std::size_t i = 0; i < layers_.layers.size(); ++i) {
    const Layer& layer = layers_.layers[i];
    const AttentionGroups& looks = groups[i % groups.size()];
    LayerSaved* place = nullptr;
    if (saved) {
      Checkpointed<LayerSaved>& kept = saved->layers.emplace_back(saved->recomputes);
      place = kept.place();
      if (saved->recomputes)
        kept.made_by([this, &layer, x, lifted, looks](Context& c, LayerSaved& out) {
          forward(c, layer, x, lifted, looks, &out, "", {});
        });
    }
    x = forward(ctx, layer, x, lifted, looks, place, "layer." + std::to_string(i) + ".", tap);
  }
  if (saved) saved->last = x;
  const long r = config_.volume;
  const Tensor out = ctx.tensor({8 * config_.voxels(), config_.out_ch}, Type::f32, "volume");
  Conv3dUpForward up;
  up.in = normed_forward(ctx, layers_.norm, x, kLastEps, "volume.normed");
  up.x = up.y = up.z = r;
  up.weights = &layers_.up.w;
  up.bias = layers_.up.bias;
  up.out = out;
  up.name = "deconv";
  conv3d_up_forward(ctx, up);
  return out;
}

Tensor LaraVolume::backward(Context& ctx, const Layer& l, const LayerSaved& s, const RowSource& lifted,
                            const AttentionGroups& groups, const Tensor& dy, const Gradients& out) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "volume.gradient"); };
  const Tensor d = like(s.x);
  {  // n + conv(n): the norm's backward is linear in its gradient, so it processes both one after the other
    const Tensor normed = normed_forward(ctx, l.norm3, s.after, kEps, "volume.normed");
    normed_backward(ctx, l.norm3, s.after, kEps, dy, d, false);
    normed_backward(ctx, l.norm3, s.after, kEps,
                    volume_conv_backward(ctx, l.conv, rows_of(normed), dy, config_.volume, "cnn"), d);
  }
  gelu_mlp_backward(ctx, {l.norm2, l.fc1, l.fc2, kEps}, s.middle, s.hidden, d);
  const Tensor dq = like(s.q), dnormed = like(s.x);
  {
    const Tensor dattended = like(s.attended), dk = like(s.k), dv = like(s.v);
    linear_backward(ctx, l.attention.out, {rows_of(s.attended), d, dattended, {}, false, "attn.out"});
    cross_attention_backward(ctx, {s.q, s.k, s.v, config_.heads, groups, s.attended, s.stats, dattended, dq, dk, dv});
    linear_backward(ctx, l.attention.k, {lifted, dk, out.samples, out.embedded, true, "attn.k"});
    linear_backward(ctx, l.attention.v, {lifted, dv, out.samples, out.embedded, true, "attn.v"});
  }
  const Tensor normed = normed_forward(ctx, l.norm1, s.x, kEps, "volume.normed");
  linear_backward(ctx, l.attention.q, {rows_of(normed), dq, dnormed, {}, false, "attn.q"});
  normed_backward(ctx, l.norm1, s.x, kEps, dnormed, d);
  return d;
}

LaraVolume::Gradients LaraVolume::backward(Context& ctx, Saved saved, const Tensor& dout) const {
  const Stage stage(ctx, "volume");
  const auto zeros = [&](const Tensor& like) {
    const Tensor out = ctx.tensor(like.shape(), Type::f32, "lifted gradient");
    ctx.fill_zero(out);
    return out;
  };
  const Gradients out{zeros(saved.lifted.x0), zeros(saved.lifted.x1)};
  Tensor d = ctx.tensor(saved.last.shape(), Type::f32, "volume.gradient");
  {
    const Tensor dnormed = ctx.tensor(saved.last.shape(), Type::f32, "volume.gradient");
    Conv3dUpBackward up;
    up.in = normed_forward(ctx, layers_.norm, saved.last, kLastEps, "volume.normed");
    up.x = up.y = up.z = config_.volume;
    up.w = layers_.up.plain;
    up.dy = dout;
    up.dx = dnormed;
    up.dw = layers_.up.dweight;
    up.dbias = layers_.up.dbias;
    up.name = "deconv";
    conv3d_up_backward(ctx, up);
    normed_backward(ctx, layers_.norm, std::exchange(saved.last, {}), kLastEps, dnormed, d, false);
  }
  const std::vector<AttentionGroups> groups = all_groups(ctx, saved.views);
  for (std::size_t i = layers_.layers.size(); i-- > 0;) {
    const LayerSaved kept = saved.layers.back().take(ctx);
    saved.layers.pop_back();
    d = backward(ctx, layers_.layers[i], kept, saved.lifted, groups[i % groups.size()], d, out);
  }
  const long c = config_.volume_ch, n = config_.voxels();
  transpose(ctx, {d, layers_.start.gradient.reshaped({c, n}), true});
  return out;
}

}  // namespace vsplat
