#include "model/networks/genden/densifier.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <utility>

#include "model/ops/dense/gather.h"
#include "model/ops/networks/confidence.h"
#include "model/ops/networks/decode.h"
#include "model/ops/volume/compact.h"
#include "model/ops/volume/top_k.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// Rows of x [N, C], selected by an index.
Tensor rows_at(Context& ctx, const Tensor& x, const Tensor& index, const char* what) {
  const Tensor out = ctx.tensor({index.dim(0), x.dim(1)}, Type::f32, what);
  gather_forward(ctx, {x, index, out});
  return out;
}

Tensor zeros_of(Context& ctx, const Shape& shape) {
  const Tensor out = ctx.tensor(shape, Type::f32, "densify gradient");
  ctx.fill_zero(out);
  return out;
}

Tensor children_rows(Context& ctx, long n) {
  std::vector<int> rows(static_cast<std::size_t>(n));
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int>(i);
  return ctx.upload({n}, rows, Type::i32, "densify.rows");
}

// Number of a level's points that continue. Computed in float, to round like the published code.
long going_on(const DensifyConfig& config, long points) {
  return static_cast<long>(std::ceil(static_cast<float>(config.non_leaf_ratio) * static_cast<float>(points)));
}

// Indices of the k largest values, and of the others, ascending.
struct Chosen {
  Tensor on, off;
};
Chosen choose(Context& ctx, const Tensor& x, long k) {
  const long n = x.dim(0);
  const Tensor flags = ctx.tensor({n}, Type::u32, "densify.flags"), others = ctx.tensor({n}, Type::u32);
  top_k(ctx, {x, k, flags, others});
  return {compact(ctx, flags, k), compact(ctx, others, n - k)};
}

}  // namespace

CurveOrders random_orders(const DensifyConfig& config, std::uint64_t seed) {
  std::mt19937 engine(static_cast<std::uint32_t>(seed));
  CurveOrders out;
  for (std::size_t s = 0; s < config.levels(); ++s) {
    std::vector<int>& order = out.emplace_back();
    for (std::size_t i = 0; i < curves_of(config).size(); ++i) order.push_back(static_cast<int>(i));
    for (std::size_t i = 0; i + 1 < order.size(); ++i) std::swap(order[i], order[i + engine() % (order.size() - i)]);
  }
  return out;
}

long densified_count(const DensifyConfig& config, long candidates) {
  long points = std::min<long>(candidates, config.top_k), out = candidates - points;
  for (std::size_t s = 0; s < config.levels(); ++s) {
    const long children = points * config.upscale[s];
    points = s + 1 == config.levels() ? 0 : going_on(config, children);
    out += children - points;
  }
  return out;
}

// What a level's backward needs besides its stage's state.
struct Densifier::LevelSaved {
  DensifyLevelStage::Saved stage;
  Tensor feature;                  // [n, C'], of the children
  Tensor sure_hidden, confidence;  // if some points continue
  Chosen chosen;
  Tensor head_input, head_hidden;  // of the points whose attributes were computed
};

struct Densifier::Saved {
  std::vector<LevelSaved> levels;
  Chosen chosen;
  Shape candidates_sh;
  std::vector<Leaves> leaves;
};

Densifier::Densifier(Context& ctx, const DensifyConfig& config, long sh_count, const WeightSource& weights)
    : config_(config), sh_count_(sh_count) {
  DensifyLayers<WeightLoader> layers(layers_of(ctx, weights), config, sh_count);
  for (std::size_t s = 0; s < config.levels(); ++s) levels_.emplace_back(config, s, std::move(layers.levels[s]));
}

std::vector<Densifier::Leaves> Densifier::grow(Context& ctx, Tensor points, Tensor feature, const CurveOrders& orders,
                                               Saved* saved, const DensifyTap& tap) const {
  std::vector<Leaves> out;
  Tensor parent;  // attributes of the points that continued
  for (std::size_t s = 0; s < levels_.size(); ++s) {
    const DensifyLevelStage& level = levels_[s];
    const std::string name = "level." + std::to_string(s) + ".";
    LevelSaved* keep = saved ? &saved->levels.emplace_back() : nullptr;
    const DensifyLevelStage::Children made =
        level.forward(ctx, points, feature, orders[s], keep ? &keep->stage : nullptr, tap);
    const long n = made.points.dim(0);
    const bool last = s + 1 == levels_.size();
    if (keep) keep->feature = made.feature;
    Tensor raw, head_input;
    if (config_.residual || last) {
      Tensor base;
      if (parent) {
        base = ctx.tensor({n, parent.dim(1)}, Type::f32, "densify.attributes");
        gather_forward(ctx, {parent, children_rows(ctx, n), base, 0, config_.upscale[s]});
      }
      head_input = made.feature;
      raw = level.head(ctx, head_input, base, keep ? &keep->head_hidden : nullptr);
    }
    if (last) {
      if (keep) keep->head_input = head_input;
      out.push_back({made.points, raw});
      if (tap) tap(name + "attributes", raw);
      break;
    }
    const Tensor confidence = ctx.tensor({n}, Type::f32, "densify.confidence");
    confidence_forward(
        ctx, {level.sureness(ctx, made.feature, keep ? &keep->sure_hidden : nullptr), config_.residual, confidence});
    if (tap) tap(name + "confidence", confidence);
    const Chosen chosen = choose(ctx, confidence, going_on(config_, n));
    if (!config_.residual) {
      head_input = rows_at(ctx, made.feature, chosen.off, "densify.leaves");
      raw = level.head(ctx, head_input, {}, keep ? &keep->head_hidden : nullptr);
    }
    if (keep) keep->head_input = head_input, keep->confidence = confidence, keep->chosen = chosen;
    out.push_back({rows_at(ctx, made.points, chosen.off, "densify.leaves"),
                   config_.residual ? rows_at(ctx, raw, chosen.off, "densify.attributes") : raw});
    if (tap) tap(name + "attributes", out.back().attributes);
    points = rows_at(ctx, made.points, chosen.on, "densify.points");
    feature = rows_at(ctx, made.feature, chosen.on, "densify.feature");
    if (config_.residual) parent = rows_at(ctx, raw, chosen.on, "densify.parents");
  }
  return out;
}

DeviceGaussians Densifier::forward(Context& ctx, const Input& in, std::shared_ptr<Saved>* saved,
                                   const DensifyTap& tap) const {
  const Stage stage(ctx, "densify");
  if (in.orders.size() != levels_.size())
    fail(Status::usage, "orders of {} levels, {} are expected", in.orders.size(), levels_.size());
  const long candidates = in.candidates.count(), k = std::min<long>(candidates, config_.top_k);
  Saved* keep = nullptr;
  if (saved) *saved = std::make_shared<Saved>(), keep = saved->get();
  const Chosen chosen = choose(ctx, in.score, k);
  if (keep) keep->chosen = chosen, keep->candidates_sh = in.candidates.sh.shape();
  if (k == 0) return in.candidates;
  const Tensor feature = in.features(ctx, chosen.on);
  if (tap) tap("selected.feature", feature);
  const std::vector<Leaves> leaves =
      grow(ctx, rows_at(ctx, in.candidates.means, chosen.on, "densify.points"), feature, in.orders, keep, tap);
  const DeviceGaussians out = make_gaussians(ctx, densified_count(config_, candidates), sh_count_, "densified");
  long row = 0;
  for (const Leaves& some : leaves) {
    decode_points_forward(ctx, {some.attributes, some.points, config_.cell / 24, row, out});
    row += some.points.dim(0);
  }
  gather_forward(ctx, in.candidates, chosen.off, out, row);
  if (keep) keep->leaves = leaves;
  return out;
}

Densifier::Gradients Densifier::backward(Context& ctx, Saved& saved, const GaussianGradients& dfinal) const {
  const Stage stage(ctx, "densify");
  const Chosen& chosen = saved.chosen;
  const long k = chosen.on.dim(0), candidates = k + chosen.off.dim(0);
  Gradients out{chosen.on, dfinal, {}};
  if (k == 0) return out;
  out.candidates = {zeros_of(ctx, {candidates, 3}), zeros_of(ctx, {candidates, 3}), zeros_of(ctx, {candidates, 4}),
                    zeros_of(ctx, {candidates}), zeros_of(ctx, saved.candidates_sh)};
  std::vector<Leaves> dleaves;
  long row = 0;
  for (const Leaves& some : saved.leaves) {
    const Leaves d{ctx.tensor(some.points.shape()), ctx.tensor(some.attributes.shape())};
    decode_points_backward(ctx, {some.attributes, config_.cell / 24, row, dfinal, d.attributes, d.points});
    dleaves.push_back(d);
    row += some.points.dim(0);
  }
  saved.leaves.clear();
  gather_backward(ctx, dfinal, chosen.off, out.candidates, row);
  const DensifyLevelStage::Children d = grow_backward(ctx, saved, dleaves);
  gather_backward(ctx, {d.points, chosen.on, out.candidates.means});
  out.features = d.feature;
  return out;
}

DensifyLevelStage::Children Densifier::grow_backward(Context& ctx, Saved& saved,
                                                     const std::vector<Leaves>& dleaves) const {
  DensifyLevelStage::Children d;  // gradient by the points that continued to the next level
  Tensor dparent;
  for (std::size_t s = levels_.size(); s-- > 0;) {
    const DensifyLevelStage& level = levels_[s];
    LevelSaved kept = std::move(saved.levels.back());
    saved.levels.pop_back();
    const bool last = s + 1 == levels_.size();
    const Leaves& leaf = dleaves[s];
    const long n = kept.feature.dim(0);
    DensifyLevelStage::Children by{leaf.points, zeros_of(ctx, kept.feature.shape())};
    Tensor draw = leaf.attributes;  // by the head's result
    if (!last) {
      by.points = zeros_of(ctx, {n, 3});
      gather_backward(ctx, {leaf.points, kept.chosen.off, by.points});
      gather_backward(ctx, {d.points, kept.chosen.on, by.points});
      gather_backward(ctx, {d.feature, kept.chosen.on, by.feature});
      if (config_.residual) {
        draw = zeros_of(ctx, {n, leaf.attributes.dim(1)});
        gather_backward(ctx, {leaf.attributes, kept.chosen.off, draw});
        gather_backward(ctx, {dparent, kept.chosen.on, draw});
      } else {
        const Tensor dinput = zeros_of(ctx, kept.head_input.shape());
        level.head_backward(ctx, kept.head_input, kept.head_hidden, draw, dinput);
        gather_backward(ctx, {dinput, kept.chosen.off, by.feature});
      }
      const Tensor dlogits = ctx.tensor({n}, Type::f32, "densify gradient");
      confidence_backward(ctx, {kept.feature, kept.confidence, config_.residual, by.feature, by.feature, dlogits});
      level.sureness_backward(ctx, kept.feature, kept.sure_hidden, dlogits, by.feature);
    }
    if (last || config_.residual) level.head_backward(ctx, kept.feature, kept.head_hidden, draw, by.feature);
    if (config_.residual && s > 0) {
      const long f = config_.upscale[s];
      dparent = zeros_of(ctx, {n / f, draw.dim(1)});
      gather_backward(ctx, {draw, children_rows(ctx, n), dparent, 0, f});
    }
    d = level.backward(ctx, std::move(kept.stage), by);
  }
  return d;
}

}  // namespace vsplat
