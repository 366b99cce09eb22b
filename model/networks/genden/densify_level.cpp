#include "model/networks/genden/densify_level.h"

#include <cmath>
#include <utility>

#include "model/ops/dense/activation.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/attention.h"
#include "model/ops/dense/gather.h"
#include "model/ops/dense/layernorm.h"
#include "model/ops/networks/upscale.h"
#include "model/ops/render/radix_sort.h"
#include "model/ops/volume/cell_map.h"
#include "model/ops/volume/sparse_conv.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr float kEps = 1e-5f;
const LayerNorm kPlain{};  // without weights

Tensor plain_norm(Context& ctx, const Tensor& x, const char* what) {
  return normed_forward(ctx, kPlain, x, kEps, what);
}

// Linear, GELU, Linear. `hidden`: receives the values before GELU for the backward, or null.
Tensor gelu_forward(Context& ctx, const Linear& first, const Linear& second, const Tensor& x, const char* name,
                    Tensor* hidden, const Tensor& base = {}) {
  Tensor h = linear_forward(ctx, first, rows_of(x), name, hidden ? Activation::none : Activation::gelu);
  if (hidden) {
    *hidden = h;
    h = ctx.tensor(h.shape(), Type::f32, name);
    activation_forward(ctx, {*hidden, Activation::gelu, h});
  }
  if (!base) return linear_forward(ctx, second, rows_of(h), name);
  add_linear(ctx, second, h, base, base, name);
  return base;
}

// dx [rows, in]: overwritten, or added to if `add` is set.
void gelu_backward(Context& ctx, const Linear& first, const Linear& second, const Tensor& x, const Tensor& hidden,
                   const Tensor& dy, const Tensor& dx, bool add, const char* name) {
  const Tensor dhidden = ctx.tensor(hidden.shape(), Type::f32, name);
  {
    const Tensor active = ctx.tensor(hidden.shape(), Type::f32, name);
    activation_forward(ctx, {hidden, Activation::gelu, active});
    linear_backward(ctx, second, {rows_of(active), dy, dhidden, {}, false, name});
  }
  activation_backward(ctx, {hidden, Activation::gelu, dhidden, dhidden});
  linear_backward(ctx, first, {rows_of(x), dhidden, dx, {}, add, name});
}

// 0, 1, 2, ...
Tensor count_up(Context& ctx, long n) {
  std::vector<int> rows(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(i);
  return ctx.upload({n}, rows, Type::i32, "densify.rows");
}

}  // namespace

double DensifyLevelStage::cell() const {
  return config_.cell / std::pow(static_cast<double>(config_.stride), static_cast<double>(s_));
}

LevelPlaces DensifyLevelStage::places(Context& ctx, const Tensor& points, const std::vector<int>& perm) const {
  const long p = points.dim(0);
  const std::vector<CurveName> curves = curves_of(config_);
  if (perm.size() != curves.size())
    fail(Status::usage, "level {}: an order of {} curves, {} are expected", s_, perm.size(), curves.size());
  LevelPlaces out;
  out.cells = grid_cells(ctx, points, cell());
  const int bits = 3 * out.cells.depth;
  const Sorted morton = radix_sort(ctx, curve_codes(ctx, out.cells, Curve::morton, false), {}, bits);
  out.codes = morton.keys, out.points = morton.values;
  out.standing = ctx.tensor({p}, Type::i32, "densify.standing");
  out.map = ctx.tensor({p, 27}, Type::i32, "densify.map");
  cell_map_forward(ctx, {out.cells, out.codes, out.points, config_.duplicates == "all", out.standing, out.map});
  std::vector<CurveRuns> made(curves.size());
  for (std::size_t i = 0; i < layers_.blocks.size(); ++i) {
    const int at = perm[i % perm.size()];
    if (at < 0 || at >= static_cast<int>(curves.size()))
      fail(Status::usage, "level {}: curve {} of {}", s_, at, curves.size());
    CurveRuns& runs = made[static_cast<std::size_t>(at)];
    if (!runs.slots) {
      const CurveName& curve = curves[static_cast<std::size_t>(at)];
      const bool known = !curve.hilbert && !curve.exchanged;
      const Tensor order =
          known ? out.points
                : radix_sort(
                      ctx, curve_codes(ctx, out.cells, curve.hilbert ? Curve::hilbert : Curve::morton, curve.exchanged),
                      {}, bits)
                      .values;
      runs = curve_runs(ctx, order, config_.patch[s_]);
    }
    out.runs.push_back(runs);
  }
  return out;
}

Tensor DensifyLevelStage::block_forward(Context& ctx, const Block& b, const LevelPlaces& places, const CurveRuns& runs,
                                        const Tensor& x, BlockSaved* saved, const std::string& name,
                                        const DensifyTap& tap) const {
  const long p = x.dim(0), c = x.dim(1), heads = config_.heads[s_];
  const auto rows = [&](const char* what) { return ctx.tensor({p, c}, Type::f32, what); };
  Tensor middle;
  {
    SubmanifoldForward conv;
    conv.in = rows_of(x);
    conv.in.map = places.map;
    conv.weights = &b.conv.w;
    conv.out = rows("densify.conv");
    conv.name = "cpe";
    submanifold_forward(ctx, conv);
    const Tensor mixed = linear_forward(ctx, b.mixed, rows_of(conv.out), "cpe.1");
    middle = plain_norm(ctx, mixed, "densify.middle");
    add_columns(ctx, {x, middle});
    if (saved) saved->x = x, saved->conv = conv.out, saved->mixed = mixed, saved->middle = middle;
  }
  if (tap) tap(name + "conv", middle);
  const Tensor after = rows("densify.after");
  {
    Tensor qkv = ctx.tensor({runs.runs * runs.size, 3 * c}, Type::f32, "densify.qkv");
    {
      const Tensor own = linear_forward(ctx, b.qkv, rows_of(plain_norm(ctx, middle, "densify.normed")), "attn.qkv");
      gather_forward(ctx, {own, runs.slots, qkv});
    }
    const Tensor attended = ctx.tensor({runs.runs, runs.size, c}, Type::f32, "densify.attended");
    const Tensor stats = saved ? ctx.tensor({runs.runs, heads, runs.size, 2}, Type::f32, "densify.stats") : Tensor();
    qkv = qkv.reshaped({runs.runs, runs.size, 3, heads, c / heads});
    attention_forward(ctx, {qkv, attended, stats});
    const Tensor gathered = rows("densify.gathered");
    gather_forward(ctx, {flat(attended), runs.places, gathered});
    add_linear(ctx, b.proj, gathered, middle, after, "attn.proj");
    if (saved) saved->qkv = qkv, saved->attended = attended, saved->stats = stats, saved->gathered = gathered;
  }
  if (tap) tap(name + "attention", after);
  const Tensor out = saved ? rows("densify.out") : after;
  gelu_mlp_forward(ctx, {kPlain, b.fc1, b.fc2, kEps}, after, out, saved ? &saved->hidden : nullptr);
  if (saved) saved->after = after;
  if (tap) tap(name + "output", out);
  return out;
}

DensifyLevelStage::Children DensifyLevelStage::forward(Context& ctx, const Tensor& points, const Tensor& feature,
                                                       const std::vector<int>& perm, Saved* saved,
                                                       const DensifyTap& tap) const {
  const LevelPlaces at = places(ctx, points, perm);
  const std::string level = "level." + std::to_string(s_) + ".";
  Tensor x = feature;
  for (std::size_t i = 0; i < layers_.blocks.size(); ++i) {
    BlockSaved* place = saved ? &saved->blocks.emplace_back() : nullptr;
    x = block_forward(ctx, layers_.blocks[i], at, at.runs[i], x, place, level + "block" + std::to_string(i) + ".", tap);
  }
  const long p = x.dim(0), c = x.dim(1), f = config_.upscale[s_], n = p * f;
  const Tensor parent = plain_norm(ctx, x, "densify.parent");
  const Tensor raw =
      gelu_forward(ctx, layers_.offset1, layers_.offset2, parent, "delta_x", saved ? &saved->offset_hidden : nullptr);
  UpscaleForward up;
  up.raw = raw, up.points = points, up.feature = parent;
  up.frequencies = config_.frequencies;
  up.reach = cell() / 2;
  // the residual model's coordinates range from -1 to 1; this only affects the frequencies
  up.unit = config_.residual ? 2 : 1;
  up.children = ctx.tensor({n, 3}, Type::f32, "densify.children");
  up.offsets = ctx.tensor({n, 3}, Type::f32, "densify.offsets");
  up.wide = ctx.tensor({n, 6L * config_.frequencies + c}, Type::f32, "densify.wide");
  upscale_forward(ctx, up);
  if (tap) tap(level + "offset", up.offsets), tap(level + "xyz", up.children);
  // Every child gets its parent's skip.
  const Tensor summed = ctx.tensor({n, layers_.skip.w.n}, Type::f32, "densify.summed");
  gather_forward(ctx, {linear_forward(ctx, layers_.skip, rows_of(parent), "skip"), count_up(ctx, n), summed, 0, f});
  gelu_forward(ctx, layers_.feature1, layers_.feature2, plain_norm(ctx, up.wide, "densify.normed"), "delta_f",
               saved ? &saved->feature_hidden : nullptr, summed);
  const Children out{up.children, plain_norm(ctx, summed, "densify.feature")};
  if (tap) tap(level + "feature", out.feature);
  if (saved) {
    saved->places = at, saved->last = x, saved->parent = parent, saved->raw = raw;
    saved->wide = up.wide, saved->summed = summed;
  }
  return out;
}

Tensor DensifyLevelStage::sureness(Context& ctx, const Tensor& feature, Tensor* hidden) const {
  return gelu_forward(ctx, layers_.sure1, layers_.sure2, feature, "mask", hidden).reshaped({feature.dim(0)});
}

void DensifyLevelStage::sureness_backward(Context& ctx, const Tensor& feature, const Tensor& hidden,
                                          const Tensor& dlogits, const Tensor& dfeature) const {
  gelu_backward(ctx, layers_.sure1, layers_.sure2, feature, hidden, dlogits.reshaped({feature.dim(0), 1}), dfeature,
                true, "mask");
}

Tensor DensifyLevelStage::head(Context& ctx, const Tensor& feature, const Tensor& base, Tensor* hidden) const {
  return gelu_forward(ctx, layers_.head1, layers_.head2, feature, "head", hidden, base);
}

void DensifyLevelStage::head_backward(Context& ctx, const Tensor& feature, const Tensor& hidden, const Tensor& draw,
                                      const Tensor& dfeature) const {
  gelu_backward(ctx, layers_.head1, layers_.head2, feature, hidden, draw, dfeature, true, "head");
}

void DensifyLevelStage::block_backward(Context& ctx, const Block& b, const LevelPlaces& places, const Tensor& back,
                                       const CurveRuns& runs, const BlockSaved& s, const Tensor& d) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "densify gradient"); };
  gelu_mlp_backward(ctx, {kPlain, b.fc1, b.fc2, kEps}, s.after, s.hidden, d);
  {
    const Tensor dattended = like(s.attended), dqkv = like(s.qkv);
    {
      const Tensor dgathered = like(s.gathered);
      linear_backward(ctx, b.proj, {rows_of(s.gathered), d, dgathered, {}, false, "attn.proj"});
      ctx.fill_zero(dattended);  // the padding of the last run has no gradient
      gather_backward(ctx, {dgathered, runs.places, flat(dattended)});
    }
    attention_backward(ctx, {s.qkv, s.attended, s.stats, dattended, dqkv});
    const long p = d.dim(0), c = d.dim(1), slots = runs.runs * runs.size;
    const Tensor down = ctx.tensor({p, 3 * c}, Type::f32, "densify gradient");
    ctx.fill_zero(down);
    // First each point's own slot, then the padding of the last run: no point occurs twice in either.
    const Tensor by_slot = dqkv.reshaped({slots, 3 * c});
    gather_backward(ctx, {by_slot, runs.slots.first(p), down, 0, 1, 0});
    if (slots > p) {
      std::vector<int> rows(static_cast<std::size_t>(slots - p));
      for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(static_cast<std::size_t>(p) + i);
      const Tensor rest = ctx.tensor({slots - p, 3 * c}, Type::f32, "densify gradient");
      gather_forward(ctx, {by_slot, ctx.upload({slots - p}, rows, Type::i32), rest});
      gather_backward(ctx, {rest, runs.filled, down});
    }
    const Tensor dnormed = like(s.middle);
    const Tensor normed = plain_norm(ctx, s.middle, "densify.normed");
    linear_backward(ctx, b.qkv, {rows_of(normed), down, dnormed, {}, false, "attn.qkv"});
    normed_backward(ctx, kPlain, s.middle, kEps, dnormed, d);
  }
  const Tensor dmixed = like(s.mixed), dconv = like(s.conv);
  normed_backward(ctx, kPlain, s.mixed, kEps, d, dmixed, false);
  linear_backward(ctx, b.mixed, {rows_of(s.conv), dmixed, dconv, {}, false, "cpe.1"});
  SubmanifoldBackward conv;
  conv.in = rows_of(s.x);
  conv.in.map = places.map;
  conv.w = b.conv.plain;
  conv.dy = dconv;
  conv.dx = d;
  conv.add = true;
  conv.dw = b.conv.dweight;
  conv.dbias = b.conv.dbias;
  conv.name = "cpe";
  conv.back = back;
  conv.back_dy = cell_sums(ctx, dconv, places.standing);
  submanifold_backward(ctx, conv);
}

DensifyLevelStage::Children DensifyLevelStage::backward(Context& ctx, Saved s, const Children& dchildren) const {
  const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "densify gradient"); };
  const long p = s.last.dim(0), f = config_.upscale[s_], n = p * f;
  const Tensor dparent = like(s.parent), dwide = like(s.wide), dsummed = like(s.summed);
  normed_backward(ctx, kPlain, s.summed, kEps, dchildren.feature, dsummed, false);
  {
    const Tensor dnormed = like(s.wide);
    const Tensor normed = plain_norm(ctx, s.wide, "densify.normed");
    gelu_backward(ctx, layers_.feature1, layers_.feature2, normed, std::exchange(s.feature_hidden, {}), dsummed,
                  dnormed, false, "delta_f");
    normed_backward(ctx, kPlain, std::exchange(s.wide, {}), kEps, dnormed, dwide, false);
  }
  {
    const Tensor dskip = ctx.tensor({p, dsummed.dim(1)}, Type::f32, "densify gradient");
    ctx.fill_zero(dskip);
    gather_backward(ctx, {dsummed, count_up(ctx, n), dskip, 0, f});
    linear_backward(ctx, layers_.skip, {rows_of(s.parent), dskip, dparent, {}, false, "skip"});
  }
  UpscaleBackward up;
  up.raw = s.raw;
  up.frequencies = config_.frequencies;
  up.reach = cell() / 2;
  up.unit = config_.residual ? 2 : 1;
  up.dchildren = dchildren.points, up.dwide = dwide;
  up.draw = like(s.raw);
  up.dpoints = ctx.tensor({p, 3}, Type::f32, "densify gradient");
  up.dfeature = dparent;
  upscale_backward(ctx, up);
  gelu_backward(ctx, layers_.offset1, layers_.offset2, s.parent, s.offset_hidden, up.draw, dparent, true, "delta_x");
  const Tensor d = like(s.last);
  normed_backward(ctx, kPlain, std::exchange(s.last, {}), kEps, dparent, d, false);
  const LevelPlaces& at = s.places;
  const Tensor back = ctx.tensor({p, 27}, Type::i32, "densify.back");
  cell_map_backward(ctx, {at.cells, at.codes, at.points, config_.duplicates == "all", at.standing, back});
  for (std::size_t i = layers_.blocks.size(); i-- > 0;) {
    const BlockSaved kept = std::move(s.blocks.back());
    s.blocks.pop_back();
    block_backward(ctx, layers_.blocks[i], at, back, at.runs[i], kept, d);
  }
  return {up.dpoints, d};
}

}  // namespace vsplat
