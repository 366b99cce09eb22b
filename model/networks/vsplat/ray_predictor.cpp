#include "model/networks/vsplat/ray_predictor.h"

#include <algorithm>
#include <cmath>

#include "model/networks/vsplat/ray_tables.h"
#include "model/ops/dense/activation.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/gather.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr float kMatchEps = 1e-5f, kLastEps = 1e-6f;

}  // namespace

RayPredictor::RayPredictor(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {
  const long rows = config.share_max_views * patches();
  positions_ = ctx.upload({rows, config.share_dim}, window_positions(config), Type::f32, "poses.positions");
  numbers_ = ctx.upload({rows, config.share_ray_dim}, view_and_token_numbers(config), Type::f32, "poses.numbers");
}

Tensor RayPredictor::rows_of_view(Context& ctx, long view, bool among_tokens) const {
  const long prefix = among_tokens ? config_.encoder_sizes().prefix() : 0, n = patches();
  std::vector<int> rows;
  for (long i = 0; i < n; ++i) rows.push_back(static_cast<int>(view * (prefix + n) + prefix + i));
  return ctx.upload({n}, rows, Type::i32, "poses.rows");
}

// Norm, SiLU and convolution, three times; norm statistics are per view.
Tensor RayPredictor::reduce(Context& ctx, const Tensor& tokens, Saved* saved) const {
  const long v = tokens.dim(0), n = patches();
  const Tensor out = ctx.tensor({v * n, config_.share_dim}, Type::f32, "poses.tokens");
  for (long view = 0; view < v; ++view) {
    Tensor x = ctx.tensor({n, config_.vit_dim}, Type::f32, "poses.features");
    gather_forward(ctx, {flat(tokens), rows_of_view(ctx, view, true), x});
    std::array<NormSaved, 3> norms;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto& layer = layers_.reduce[i];
      const RowSource in = norm_silu_forward(ctx, layer.norm, x, {}, saved ? &norms[i] : nullptr);
      if (i < 2) {
        x = linear_forward(ctx, layer.conv, in, "share.reduce");
        continue;
      }
      Gemm g;
      g.a = in;
      g.b = &layer.conv.w;
      g.bias = layer.conv.bias;
      g.residual = positions_;
      g.out = out;
      g.out_row0 = view * n;
      g.name = "share.reduce";
      gemm(ctx, g);
    }
    if (saved) saved->reduce.push_back(norms);
  }
  return out;
}

void RayPredictor::reduce_backward(Context& ctx, const Saved& saved, const Tensor& dx, const Tensor& dtokens) const {
  const long n = patches();
  for (std::size_t view = 0; view < saved.reduce.size(); ++view) {
    const auto number = static_cast<long>(view);
    Tensor d = ctx.tensor({n, config_.share_dim}, Type::f32, "poses.gradient");
    gather_forward(ctx, {dx, rows_of_view(ctx, number, false), d});
    for (std::size_t i = 3; i-- > 0;) {
      const auto& layer = layers_.reduce[i];
      const NormSaved& norm = saved.reduce[view][i];
      const Tensor by_input = ctx.tensor(norm.rows.x0.shape(), Type::f32, "poses.gradient");
      linear_backward(ctx, layer.conv, {norm.rows, d, by_input, {}, false, "share.reduce"});
      norm_silu_backward(ctx, layer.norm, norm, by_input, by_input);
      d = by_input;
    }
    if (!config_.share_detach) gather_backward(ctx, {d, rows_of_view(ctx, number, true), flat(dtokens)});
  }
}

AttentionGroups RayPredictor::groups(Context& ctx, long views, std::size_t block, bool across) const {
  return match_groups(ctx, views, config_.tokens(), config_.share_splits, block % 2 == 1, across,
                      config_.share_cross_mask == "tiled");
}

// x + norm(merge(attention)), or x + norm2(MLP([x, norm(merge(attention))])).
Tensor RayPredictor::match(Context& ctx, const Matching& l, const Tensor& x, const Tensor& target,
                           const AttentionGroups& groups, MatchSaved* saved) const {
  const auto rows = [&](const char* what) { return ctx.tensor(x.shape(), Type::f32, what); };
  MatchSaved s;
  s.x = x, s.target = target;
  s.q = linear_forward(ctx, l.q, rows_of(x), "match.q");
  s.k = linear_forward(ctx, l.k, rows_of(target), "match.k");
  s.v = linear_forward(ctx, l.v, rows_of(target), "match.v");
  s.attended = rows("match.attended");
  if (saved) s.stats = ctx.tensor({x.dim(0), 1}, Type::f32, "match.stats");
  cross_attention_forward(ctx, {s.q, s.k, s.v, 1, groups, s.attended, s.stats});
  s.merged = linear_forward(ctx, l.merge, rows_of(s.attended), "match.merge");
  s.message = normed_forward(ctx, l.norm1, s.merged, kMatchEps, "match.message");
  Tensor out = s.message;
  if (l.norm2.gamma) {
    RowSource both = rows_of(x);
    both.x1 = s.message;
    s.hidden = linear_forward(ctx, l.mlp0, both, "match.mlp.0", saved ? Activation::none : Activation::gelu);
    Tensor active = s.hidden;
    if (saved) {
      active = ctx.tensor(s.hidden.shape(), Type::f32, "match.active");
      activation_forward(ctx, {s.hidden, Activation::gelu, active});
    }
    s.out = linear_forward(ctx, l.mlp2, rows_of(active), "match.mlp.2");
    out = normed_forward(ctx, l.norm2, s.out, kMatchEps, "match.out");
  } else if (saved) {
    s.message = {};  // x is added and it becomes the result
  }
  add_columns(ctx, {x, out});
  if (saved) *saved = s;
  return out;
}

void RayPredictor::match_backward(Context& ctx, const Matching& l, const MatchSaved& s, const AttentionGroups& groups,
                                  const Tensor& d, const Tensor& dtarget) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "match.gradient"); };
  const Tensor dmerged = like(s.merged);
  if (l.norm2.gamma) {
    const Tensor dmessage = like(s.x), dhidden = like(s.hidden);
    ctx.fill_zero(dmessage);
    {
      const Tensor dout = like(s.out), active = like(s.hidden);
      normed_backward(ctx, l.norm2, s.out, kMatchEps, d, dout, false);
      activation_forward(ctx, {s.hidden, Activation::gelu, active});
      linear_backward(ctx, l.mlp2, {rows_of(active), dout, dhidden, {}, false, "match.mlp.2"});
    }
    activation_backward(ctx, {s.hidden, Activation::gelu, dhidden, dhidden});
    RowSource both = rows_of(s.x);
    both.x1 = s.message;
    linear_backward(ctx, l.mlp0, {both, dhidden, d, dmessage, true, "match.mlp.0"});
    normed_backward(ctx, l.norm1, s.merged, kMatchEps, dmessage, dmerged, false);
  } else {
    normed_backward(ctx, l.norm1, s.merged, kMatchEps, d, dmerged, false);
  }
  const Tensor dattended = like(s.attended), dq = like(s.q), dk = like(s.k), dv = like(s.v);
  linear_backward(ctx, l.merge, {rows_of(s.attended), dmerged, dattended, {}, false, "match.merge"});
  cross_attention_backward(ctx, {s.q, s.k, s.v, 1, groups, s.attended, s.stats, dattended, dq, dk, dv});
  linear_backward(ctx, l.q, {rows_of(s.x), dq, d, {}, true, "match.q"});
  linear_backward(ctx, l.k, {rows_of(s.target), dk, dtarget, {}, true, "match.k"});
  linear_backward(ctx, l.v, {rows_of(s.target), dv, dtarget, {}, true, "match.v"});
}

Tensor RayPredictor::forward(Context& ctx, const Tensor& tokens, Saved* saved, const Tap& tap) const {
  const Stage stage(ctx, "poses");
  const long v = tokens.dim(0), n = patches(), t = config_.tokens();
  if (v < 2 || v > config_.share_max_views)
    fail(Status::usage, "{} views given, but a network that predicts poses takes 2 to share_max_views = {}", v,
         config_.share_max_views);
  const auto report = [&](const std::string& name, const Tensor& x) {
    if (tap) tap("share." + name, x.reshaped({v, t, t, x.shape().back()}));
  };
  if (saved) *saved = {}, saved->tokens = tokens.shape();
  Tensor x = reduce(ctx, tokens, saved);
  report("positioned", x);
  if (saved) saved->matching.resize(2 * layers_.matching.size());
  for (std::size_t i = 0; i < layers_.matching.size(); ++i) {
    const std::string name = "match" + std::to_string(i);
    const Tensor before = x;  // the other views attend to this
    x = match(ctx, layers_.matching[i].self, x, x, groups(ctx, v, i, false), saved ? &saved->matching[2 * i] : nullptr);
    report(name + ".self", x);
    x = match(ctx, layers_.matching[i].cross, x, before, groups(ctx, v, i, true),
              saved ? &saved->matching[2 * i + 1] : nullptr);
    report(name, x);
  }
  if (saved) saved->matched = x;
  if (config_.share_pre_conv) {
    x = linear_forward(ctx, layers_.pre_conv, rows_of(x), "share.pre_conv");
    report("pre_conv", x);
  }
  RowSource in = rows_of(x);
  if (config_.share_view_dim > 0) {
    std::vector<int> view_of_row(static_cast<std::size_t>(v * n));
    for (long i = 0; i < v * n; ++i) view_of_row[static_cast<std::size_t>(i)] = static_cast<int>(i / n);
    in.x1 = ctx.tensor({v * n, config_.share_view_dim}, Type::f32, "poses.codes");
    gather_forward(ctx, {layers_.view_code.value, ctx.upload({v * n}, view_of_row, Type::i32, "poses.view"), in.x1});
  }
  if (saved) saved->before_embedding = x, saved->codes = in.x1;
  Gemm g;
  g.a = in;
  g.b = &layers_.embedder.w;
  g.bias = layers_.embedder.bias;
  g.residual = numbers_;
  g.out = ctx.tensor({v * n, config_.share_ray_dim}, Type::f32, "poses.rays");
  g.name = "share.embedder";
  gemm(ctx, g);
  report("embedded", g.out);
  x = g.out.reshaped({1, v * n, config_.share_ray_dim});
  if (saved) saved->blocks.resize(layers_.blocks.size());
  for (std::size_t i = 0; i < layers_.blocks.size(); ++i) {
    x = block_forward(ctx, layers_.blocks[i], block_options(), x, saved ? &saved->blocks[i] : nullptr);
    report("ray" + std::to_string(i), x);
  }
  if (saved) saved->last = x;
  const Tensor normed = normed_forward(ctx, layers_.norm, x, kLastEps, "poses.normed");
  const Tensor out = linear_forward(ctx, layers_.head, rows_of(normed), "share.head").reshaped({v, t, t, 6});
  report("plucker", out);
  return out;
}

void RayPredictor::backward(Context& ctx, const Saved& s, const Tensor& drays, const Tensor& dtokens) const {
  const Stage stage(ctx, "poses");
  if (!layers_.norm.dgamma) fail(Status::internal, "the predictor's weights have no gradients: it is for inference");
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "poses.gradient"); };
  const long rows = s.matched.dim(0), v = rows / patches();
  const Tensor d = like(flat(s.last));
  {
    const Tensor dnormed = like(d);
    const Tensor normed = normed_forward(ctx, layers_.norm, s.last, kLastEps, "poses.normed");
    linear_backward(ctx, layers_.head, {rows_of(normed), drays.reshaped({rows, 6}), dnormed, {}, false, "share.head"});
    normed_backward(ctx, layers_.norm, s.last, kLastEps, dnormed, d, false);
  }
  for (std::size_t i = layers_.blocks.size(); i-- > 0;)
    block_backward(ctx, layers_.blocks[i], block_options(), s.blocks[i], d);
  Tensor dx = like(s.before_embedding);
  {
    RowSource in = rows_of(s.before_embedding);
    in.x1 = s.codes;
    const Tensor dcodes = s.codes ? like(s.codes) : Tensor();
    linear_backward(ctx, layers_.embedder, {in, d, dx, dcodes, false, "share.embedder"});
    if (dcodes) {  // each view's sum, as a product with a matrix that has ones where a row belongs to the view
      const long codes = config_.share_max_views;
      std::vector<float> ones(static_cast<std::size_t>(rows * codes), 0.0f);
      for (long i = 0; i < rows; ++i) ones[static_cast<std::size_t>(i * codes + i / patches())] = 1;
      transposed_gemm(ctx, {ctx.upload({rows, codes}, ones, Type::f32, "poses.ones"), dcodes,
                            layers_.view_code.gradient, true, "share.view_pos_emb"});
    }
  }
  if (config_.share_pre_conv) {
    const Tensor by_matched = like(s.matched);
    linear_backward(ctx, layers_.pre_conv, {rows_of(s.matched), dx, by_matched, {}, false, "share.pre_conv"});
    dx = by_matched;
  }
  for (std::size_t i = layers_.matching.size(); i-- > 0;) {
    const Tensor dbefore = like(dx);
    ctx.fill_zero(dbefore);
    match_backward(ctx, layers_.matching[i].cross, s.matching[2 * i + 1], groups(ctx, v, i, true), dx, dbefore);
    match_backward(ctx, layers_.matching[i].self, s.matching[2 * i], groups(ctx, v, i, false), dx, dx);
    add_columns(ctx, {dbefore, dx});
  }
  reduce_backward(ctx, s, dx, dtokens);
}

}  // namespace vsplat
