#include "model/refine.h"

#include "model/ops/gather.h"
#include "model/ops/position_encoding.h"
#include "model/ops/project_features.h"
#include "model/ops/sparse_map.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// A submanifold convolution of `in`, whose rows are the active voxels; `map` none for a 1x1x1. residual and out may be
// the same.
Tensor convolve(Context& ctx, const Conv& conv, RowSource in, const Tensor& map, const char* name,
                const Tensor& residual = {}) {
  Gemm g;
  g.a = std::move(in);
  g.a.map = map;
  g.b = &conv.w.w;
  g.bias = conv.w.bias;
  g.residual = residual;
  g.out = residual ? residual : ctx.tensor({g.a.x0.dim(0), conv.w.cout}, Type::f32, name);
  g.name = name;
  gemm(ctx, g);
  return g.out;
}

}  // namespace

Refinement::Refinement(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "voxel_network.");
  const long ch = config.voxel_ch, extra = config.projected_ch(), k = config.refine_out_kernel;
  comp_linear_ = load_linear(load, "comp_linear", extra + config.volume_ch + kPositionEncoding, ch);
  conv_in_ = load.submanifold("conv_in", ch, 3, ch);
  for (int i = 0; i < config.voxel_levels; ++i) {
    for (int j = 0; j < 2; ++j) {
      const std::string name = "conv_blocks." + std::to_string(i) + ".res." + std::to_string(j);
      blocks_.push_back({load_group_norm(load, name + ".norm1.group_norm", ch, config.groups),
                         load_group_norm(load, name + ".norm2.group_norm", ch, config.groups),
                         load.submanifold(name + ".conv1", ch, 3, ch), load.submanifold(name + ".conv2", ch, 3, ch)});
    }
  }
  norm_out_ = load_group_norm(load, "norm_out.group_norm", ch + extra, config.groups);
  conv_out_ = load.submanifold("conv_out", config.fine_dim, k, ch + extra);
}

Refinement::Output Refinement::forward(Context& ctx, const Input& in) const {
  const Stage stage(ctx, "refinement");
  const long c = config_.volume_ch;
  Dims d;
  d.set("R^3", config_.voxels())
      .set("C", c)
      .bind("volume", in.volume, {"R^3", "C"})
      .bind("means", in.means, {"P", "3"});
  const long p = d["P"];
  Output out;
  if (config_.use_projected) {
    ProjectFeaturesForward a;
    a.features = in.features;
    a.points = in.means;
    a.cameras = in.cameras;
    a.image = config_.image;
    a.half_pixel = config_.sample_half_pixel;
    a.by_distance = config_.view_weight == "distance";
    a.out = out.projected = ctx.tensor({p, config_.vit_dim}, Type::f32, "projected");
    project_features_forward(ctx, a);
  }
  const Tensor map = ctx.tensor({p, 27}, Type::i32, "sparse_map");
  sparse_map_forward(ctx, {in.index, config_.volume, map});

  Tensor h;
  {
    const Tensor own = ctx.tensor({p, c + kPositionEncoding}, Type::f32, "volume and position");
    gather_forward(ctx, {in.volume, in.index, own});
    position_encoding_forward(ctx, {in.means, own, c});
    RowSource x;
    x.x0 = out.projected ? out.projected : own;
    if (out.projected) x.x1 = own;
    h = linear(ctx, comp_linear_, x, "comp_linear");
  }
  {
    RowSource x;
    x.x0 = std::move(h);
    h = convolve(ctx, conv_in_, x, map, "conv_in");
  }
  for (const ResBlock& block : blocks_) {
    const Tensor inner = convolve(ctx, block.conv1, norm_silu(ctx, block.norm1, h), map, "res.conv1");
    convolve(ctx, block.conv2, norm_silu(ctx, block.norm2, inner), map, "res.conv2", h);
  }
  out.refined = convolve(ctx, conv_out_, norm_silu(ctx, norm_out_, h, out.projected),
                         config_.refine_out_kernel == 1 ? Tensor() : map, "conv_out");
  return out;
}

}  // namespace vsplat
