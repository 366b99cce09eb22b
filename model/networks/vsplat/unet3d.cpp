#include "model/networks/vsplat/unet3d.h"

#include <utility>

#include "model/ops/dense/add_columns.h"
#include "model/ops/volume/upsample3d.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

Tensor downsample(Context& ctx, const Conv& conv, const Tensor& x, long edge) {
  Conv3dDownForward c;
  c.in.x0 = x;
  c.in.map = conv3d_down_map(ctx, edge, edge, edge);
  c.weights = &conv.w;
  c.out = ctx.tensor({edge / 2 * (edge / 2) * (edge / 2), conv.w.cout}, Type::f32, "downsample.conv");
  c.name = "downsample.conv";
  conv3d_down_forward(ctx, c);
  return c.out;
}

// Adds the gradient by x at edge^3 voxels to dx.
void downsample_backward(Context& ctx, const Conv& conv, const Tensor& x, const Tensor& dy, const Tensor& dx,
                         long edge) {
  Conv3dDownBackward g;
  g.in.x0 = x;
  g.in.map = conv3d_down_map(ctx, edge, edge, edge);
  g.w = conv.plain;
  g.dy = dy;
  g.dx = dx;
  g.dw = conv.dweight;
  g.dbias = conv.dbias;
  conv3d_down_backward(ctx, g);
}

Tensor upsample(Context& ctx, const Tensor& x, long edge) {
  const Tensor y = ctx.tensor({8 * edge * edge * edge, x.dim(1)}, Type::f32, "upsample");
  upsample3d_forward(ctx, {x, edge, edge, edge, y});
  return y;
}

// dy at 2 edge -> gradient by x at `edge`.
Tensor upsample_backward(Context& ctx, const Tensor& dy, long edge) {
  const Tensor dx = ctx.tensor({edge * edge * edge, dy.dim(1)}, Type::f32, "upsample gradient");
  upsample3d_backward(ctx, {dy, edge, edge, edge, dx});
  return dx;
}

template <class T>
T take_last(std::vector<T>& from) {
  T out = std::move(from.back());
  from.pop_back();
  return out;
}

}  // namespace

VolumeNetwork::VolumeNetwork(Context& ctx, const Config& config, const WeightSource& weights)
    : config_(config), layers_(layers_of(ctx, weights), config) {}

Tensor VolumeNetwork::res(Context& ctx, const ResBlock& block, Tensor x0, Tensor x1, long edge, ResSaved* saved) const {
  const Tensor h = volume_conv_forward(ctx, block.conv1,
                                       norm_silu_forward(ctx, block.norm1, x0, x1, saved ? &saved->norm1 : nullptr),
                                       edge, "res.conv1");
  Tensor residual = x0, out;
  if (block.shortcut.bias) {
    RowSource x;
    x.x0 = std::move(x0);
    x.x1 = std::move(x1);
    residual = out = linear_forward(ctx, block.shortcut, x, "res.nin_shortcut");
  }
  return volume_conv_forward(ctx, block.conv2,
                             norm_silu_forward(ctx, block.norm2, h, {}, saved ? &saved->norm2 : nullptr), edge,
                             "res.conv2", residual, out);
}

Tensor VolumeNetwork::forward(Context& ctx, Tensor volume, Saved* saved) const {
  const Stage stage(ctx, "volume");
  const long ch = config_.volume_ch;
  Dims().set("R^3", config_.voxels()).set("C", 4 * ch).bind("volume", volume, {"R^3", "C"});
  const auto keep = [&](std::vector<ResSaved> Saved::*list) {
    return saved ? &(saved->*list).emplace_back() : nullptr;
  };
  if (saved) *saved = {};
  long edge = config_.volume;
  Tensor h = volume_conv_forward(
      ctx, layers_.conv_in,
      norm_silu_forward(ctx, layers_.norm_in, std::exchange(volume, {}), {}, saved ? &saved->norm_in : nullptr), edge,
      "conv_in.3");
  std::vector<Tensor> skips = {h};
  for (const auto& level : layers_.down) {
    h = res(ctx, level.res, std::move(h), {}, edge, keep(&Saved::down));
    skips.push_back(h);
    if (level.downsample.w.bias) {
      if (saved) saved->downsampled.push_back(h);
      h = downsample(ctx, level.downsample, h, edge);
      edge /= 2;
      skips.push_back(h);
    }
  }
  h = res(ctx, layers_.mid, std::move(h), {}, edge, saved ? &saved->mid : nullptr);
  for (std::size_t i = 0; i < layers_.up.size(); ++i) {
    for (const ResBlock& block : layers_.up[i].res)
      h = res(ctx, block, std::move(h), take_last(skips), edge, keep(&Saved::up));
    if (i + 1 < layers_.up.size()) {
      h = upsample(ctx, h, edge);
      edge *= 2;
    }
  }
  return volume_conv_forward(
      ctx, layers_.conv_out,
      norm_silu_forward(ctx, layers_.norm_out, std::exchange(h, {}), {}, saved ? &saved->norm_out : nullptr), edge,
      "conv_out");
}

std::pair<Tensor, Tensor> VolumeNetwork::res_backward(Context& ctx, const ResBlock& block, ResSaved saved, Tensor dy,
                                                      long edge) const {
  Tensor dh = volume_conv_backward(ctx, block.conv2, saved.norm2.rows, dy, edge, "res.conv2");
  norm_silu_backward(ctx, block.norm2, std::exchange(saved.norm2, {}), dh, dh);
  const Tensor dcomposed =
      volume_conv_backward(ctx, block.conv1, saved.norm1.rows, std::exchange(dh, {}), edge, "res.conv1");
  Tensor dx0 = dy, dx1;  // for a residual that is x0 itself
  if (block.shortcut.bias) {
    RowSource x;
    x.x0 = saved.norm1.rows.x0;
    x.x1 = saved.norm1.rows.x1;
    dx0 = ctx.tensor(x.x0.shape(), Type::f32, "res gradient");
    if (x.x1) dx1 = ctx.tensor(x.x1.shape(), Type::f32, "res gradient");
    linear_backward(ctx, block.shortcut, {x, std::exchange(dy, {}), dx0, dx1, false, "res.nin_shortcut"});
  }
  norm_silu_backward(ctx, block.norm1, saved.norm1, dcomposed, dx0, dx1, true);
  return {dx0, dx1};
}

Tensor VolumeNetwork::backward(Context& ctx, Saved saved, Tensor dout) const {
  const Stage stage(ctx, "volume");
  Dims().set("R^3", config_.voxels()).set("C~", config_.volume_ch).bind("dout", dout, {"R^3", "C~"});
  long edge = config_.volume;
  Tensor d =
      volume_conv_backward(ctx, layers_.conv_out, saved.norm_out.rows, std::exchange(dout, {}), edge, "conv_out");
  norm_silu_backward(ctx, layers_.norm_out, std::exchange(saved.norm_out, {}), d, d);
  std::vector<Tensor> dskips;  // the first skip's gradient comes first, since the forward uses it last
  for (std::size_t i = layers_.up.size(); i-- > 0;) {
    for (const int j : {1, 0}) {
      auto [dx, dskip] = res_backward(ctx, layers_.up[i].res[j], take_last(saved.up), std::move(d), edge);
      d = std::move(dx);
      dskips.push_back(std::move(dskip));
    }
    if (i > 0) {
      edge /= 2;
      d = upsample_backward(ctx, d, edge);
    }
  }
  d = res_backward(ctx, layers_.mid, std::exchange(saved.mid, {}), std::move(d), edge).first;
  for (std::size_t i = layers_.down.size(); i-- > 0;) {
    add_columns(ctx, {take_last(dskips), d});
    if (layers_.down[i].downsample.w.bias) {
      edge *= 2;
      const Tensor dx = take_last(dskips);
      downsample_backward(ctx, layers_.down[i].downsample, take_last(saved.downsampled), d, dx, edge);
      d = dx;
    }
    d = res_backward(ctx, layers_.down[i].res, take_last(saved.down), std::move(d), edge).first;
  }
  add_columns(ctx, {take_last(dskips), d});
  d = volume_conv_backward(ctx, layers_.conv_in, saved.norm_in.rows, d, edge, "conv_in.3");
  norm_silu_backward(ctx, layers_.norm_in, saved.norm_in, d, d);
  return d;
}

}  // namespace vsplat
