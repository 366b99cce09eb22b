#include "model/networks/vsplat/voxel_refiner.h"

#include "model/ops/dense/gather.h"
#include "model/ops/networks/position_encoding.h"
#include "model/ops/networks/project_features.h"
#include "model/ops/volume/sparse_conv.h"
#include "model/ops/volume/sparse_map.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

static_assert(kPositionEncoding == kPositionValues);

// A submanifold convolution of `in`, whose rows are the active voxels, into `out`. `map` is empty for a 1x1x1. residual
// and out may be the same.
void convolve(Context& ctx, const Conv& conv, RowSource in, const Tensor& map, const char* name, const Tensor& out,
              const Tensor& residual = {}) {
  SubmanifoldForward a;
  a.in = std::move(in);
  a.in.map = map;
  a.weights = &conv.w;
  a.residual = residual;
  a.out = out;
  a.name = name;
  submanifold_forward(ctx, a);
}

// Overwrites dx, the gradient by the composed rows.
void convolve_backward(Context& ctx, const Conv& conv, RowSource in, const Tensor& map, const char* name,
                       const Tensor& dy, const Tensor& dx) {
  SubmanifoldBackward b;
  b.in = std::move(in);
  b.in.map = map;
  b.w = conv.plain;
  b.dy = dy;
  b.dx = dx;
  b.dw = conv.dweight;
  b.dbias = conv.dbias;
  b.name = name;
  submanifold_backward(ctx, b);
}

// Joins two sources, the first of which may be empty.
RowSource beside(const Tensor& first, const Tensor& second) {
  RowSource out;
  out.x0 = first ? first : second;
  if (first) out.x1 = second;
  return out;
}

// All arguments but `out`. Refers to `cameras`.
ProjectFeaturesForward projection(const Config& config, const Tensor& features, const DeviceCameras& cameras,
                                  const Tensor& means) {
  ProjectFeaturesForward a;
  a.features = features;
  a.points = means;
  a.cameras = &cameras;
  a.image = config.image;
  a.half_pixel = config.sample_half_pixel;
  a.by_distance = config.view_weight == "distance";
  return a;
}

}  // namespace

Refinement::Refinement(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

Refinement::Output Refinement::forward(Context& ctx, const Input& in, Saved* saved) const {
  const Stage stage(ctx, "refinement");
  const long c = config_.volume_ch;
  Dims d;
  d.set("R^3", config_.voxels())
      .set("C", c)
      .bind("volume", in.volume, {"R^3", "C"})
      .bind("means", in.means, {"P", "3"});
  const long p = d["P"];
  const auto rows = [&](long width, const char* what) { return ctx.tensor({p, width}, Type::f32, what); };
  Output out;
  if (config_.use_projected) {
    ProjectFeaturesForward a = projection(config_, in.features, *in.cameras, in.means);
    a.out = out.projected = rows(config_.vit_dim, "projected");
    project_features_forward(ctx, a);
  }
  const Tensor map = ctx.tensor({p, 27}, Type::i32, "sparse_map");
  sparse_map_forward(ctx, {in.index, config_.volume, map});

  Tensor h;
  {
    const Tensor own = rows(c + kPositionEncoding, "volume and position");
    gather_forward(ctx, {in.volume, in.index, own});
    position_encoding_forward(ctx, {in.means, own, c});
    h = linear_forward(ctx, layers_.comp_linear, beside(out.projected, own), "comp_linear");
    const DeviceCameras cameras = in.cameras ? *in.cameras : DeviceCameras();
    if (saved) *saved = {in.features, in.means, in.index, cameras, own, out.projected, map, h, {}, {}};
  }
  {
    RowSource x;
    x.x0 = std::move(h);
    h = rows(config_.voxel_ch, "conv_in");
    convolve(ctx, layers_.conv_in, x, map, "conv_in", h);
  }
  for (const auto& block : layers_.blocks) {
    NormSaved* norms[2] = {};
    if (saved) {
      Saved::Block& kept = saved->blocks.emplace_back();
      norms[0] = &kept.norm1, norms[1] = &kept.norm2;
    }
    const Tensor inner = rows(config_.voxel_ch, "res.conv1");
    convolve(ctx, block.conv1, norm_silu_forward(ctx, block.norm1, h, {}, norms[0]), map, "res.conv1", inner);
    const Tensor sum = saved ? rows(config_.voxel_ch, "res.conv2") : h;
    convolve(ctx, block.conv2, norm_silu_forward(ctx, block.norm2, inner, {}, norms[1]), map, "res.conv2", sum, h);
    h = sum;
  }
  out.refined = rows(config_.fine_dim, "conv_out");
  convolve(ctx, layers_.conv_out,
           norm_silu_forward(ctx, layers_.norm_out, h, out.projected, saved ? &saved->norm_out : nullptr),
           config_.refine_out_kernel == 1 ? Tensor() : map, "conv_out", out.refined);
  return out;
}

void Refinement::backward(Context& ctx, const Saved& saved, const Tensor& drefined, const Gradients& out) const {
  const Stage stage(ctx, "refinement");
  const long p = saved.means.dim(0), ch = config_.voxel_ch;
  if (p == 0) return;
  const auto rows = [&](long width, const char* what) { return ctx.tensor({p, width}, Type::f32, what); };

  Tensor dh = rows(ch, "gradient");
  const Tensor dprojected = saved.projected ? rows(config_.vit_dim, "gradient by projected") : Tensor();
  {
    const Tensor both = rows(ch + config_.projected_ch(), "gradient");
    convolve_backward(ctx, layers_.conv_out, saved.norm_out.rows, config_.refine_out_kernel == 1 ? Tensor() : saved.map,
                      "conv_out", drefined, both);
    norm_silu_backward(ctx, layers_.norm_out, saved.norm_out, both, dh, dprojected);
  }
  {
    const Tensor inside = rows(ch, "gradient"), next = rows(ch, "gradient");
    for (std::size_t i = layers_.blocks.size(); i-- > 0;) {
      const auto& block = layers_.blocks[i];
      const Saved::Block& kept = saved.blocks[i];
      convolve_backward(ctx, block.conv2, kept.norm2.rows, saved.map, "res.conv2", dh, inside);
      norm_silu_backward(ctx, block.norm2, kept.norm2, inside, inside);
      convolve_backward(ctx, block.conv1, kept.norm1.rows, saved.map, "res.conv1", inside, next);
      norm_silu_backward(ctx, block.norm1, kept.norm1, next, dh, {}, true);
    }
  }
  RowSource linear_out;
  linear_out.x0 = saved.linear;
  {
    const Tensor dlinear = rows(ch, "gradient");
    convolve_backward(ctx, layers_.conv_in, linear_out, saved.map, "conv_in", dh, dlinear);
    dh = dlinear;
  }

  // The projected features also entered before the last layer: adds up both gradients.
  const Tensor down = rows(config_.volume_ch + kPositionEncoding, "gradient");
  ctx.fill_zero(down);
  LinearBackward b;
  b.in = beside(saved.projected, saved.volume_position);
  b.dy = dh;
  b.dx0 = dprojected ? dprojected : down;
  if (dprojected) b.dx1 = down;
  b.add = true;
  b.name = "comp_linear";
  linear_backward(ctx, layers_.comp_linear, b);
  gather_backward(ctx, {down, saved.index, out.volume});
  position_encoding_backward(ctx, {saved.means, down, out.means, config_.volume_ch});
  if (dprojected) {
    project_features_backward(
        ctx, {projection(config_, saved.features, saved.cameras, saved.means), dprojected, out.features, out.means});
  }
}

}  // namespace vsplat
