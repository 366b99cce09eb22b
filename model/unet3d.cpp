#include "model/unet3d.h"

#include <utility>

#include "model/ops/resample3d.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

Tensor convolve(Context& ctx, const Conv& conv, const RowSource& in, long edge, const char* name,
                const Tensor& residual = {}, const Tensor& out = {}) {
  Conv3d c;
  c.in = in;
  c.x = c.y = c.z = edge;
  c.weights = &conv.w;
  c.residual = residual;
  c.out = out ? out : ctx.tensor({edge * edge * edge, conv.w.cout}, Type::f32, name);
  c.name = name;
  conv3d(ctx, c);
  return c.out;
}

Tensor downsample(Context& ctx, const Conv& conv, const Tensor& x, long edge) {
  Conv3dDown c;
  c.in.x0 = x;
  c.in.map = conv3d_down_map(ctx, edge, edge, edge);
  c.weights = &conv.w;
  c.out = ctx.tensor({edge / 2 * (edge / 2) * (edge / 2), conv.w.cout}, Type::f32, "downsample.conv");
  c.name = "downsample.conv";
  conv3d_down(ctx, c);
  return c.out;
}

Tensor upsample(Context& ctx, const Tensor& x, long edge) {
  const Tensor y = ctx.tensor({8 * edge * edge * edge, x.dim(1)}, Type::f32, "upsample");
  upsample3d_forward(ctx, {x, edge, edge, edge, y});
  return y;
}

}  // namespace

VolumeNetwork::VolumeNetwork(Context& ctx, const Config& config, const WeightSource& weights) : config_(config) {
  const WeightLoader load(ctx, weights, "volume_network.");
  const long ch = config.volume_ch;
  const auto levels = config.volume_mult.size();
  norm_in_ = load_group_norm(load, "conv_in.1", 4 * ch, config.groups);
  conv_in_ = load.conv3d("conv_in.3", ch, 4 * ch);
  std::vector<long> skips = {ch};
  long width = ch;
  for (std::size_t i = 0; i < levels; ++i) {
    const std::string name = "down_blocks." + std::to_string(i);
    Down level{load_res(load, name + ".res.0", width, ch * config.volume_mult[i]), {}};
    width = ch * config.volume_mult[i];
    skips.push_back(width);
    if (i + 1 < levels) {
      level.downsample = load.conv3d_down(name + ".downsample.conv", width, width);
      skips.push_back(width);
    }
    down_.push_back(level);
  }
  mid_ = load_res(load, "mid.0", width, width);
  for (std::size_t i = 0; i < levels; ++i) {
    const long out = ch * config.volume_mult[levels - 1 - i];
    Up level;
    for (int j = 0; j < 2; ++j) {
      const std::string name = "up_blocks." + std::to_string(i) + ".res." + std::to_string(j);
      level.res[j] = load_res(load, name, width + skips.back(), out);
      skips.pop_back();
      width = out;
    }
    up_.push_back(level);
  }
  norm_out_ = load_group_norm(load, "norm_out", width, config.groups);
  conv_out_ = load.conv3d("conv_out", ch, width);
}

VolumeNetwork::ResBlock VolumeNetwork::load_res(const WeightLoader& weights, const std::string& name, long in,
                                                long out) const {
  ResBlock block;
  block.norm1 = load_group_norm(weights, name + ".norm1", in, config_.groups);
  block.conv1 = weights.conv3d(name + ".conv1", out, in);
  block.norm2 = load_group_norm(weights, name + ".norm2", out, config_.groups);
  block.conv2 = weights.conv3d(name + ".conv2", out, out);
  if (in != out) block.shortcut = load_pointwise(weights, name + ".nin_shortcut", in, out);
  return block;
}

Tensor VolumeNetwork::res(Context& ctx, const ResBlock& block, Tensor x0, Tensor x1, long edge) const {
  const Tensor h = convolve(ctx, block.conv1, norm_silu(ctx, block.norm1, x0, x1), edge, "res.conv1");
  Tensor residual = x0, out;
  if (block.shortcut.bias) {
    RowSource x;
    x.x0 = std::move(x0);
    x.x1 = std::move(x1);
    residual = out = linear(ctx, block.shortcut, x, "res.nin_shortcut");
  }
  return convolve(ctx, block.conv2, norm_silu(ctx, block.norm2, h), edge, "res.conv2", residual, out);
}

Tensor VolumeNetwork::forward(Context& ctx, Tensor volume) const {
  const Stage stage(ctx, "volume");
  const long ch = config_.volume_ch;
  Dims().set("R^3", config_.voxels()).set("C", 4 * ch).bind("volume", volume, {"R^3", "C"});
  long edge = config_.volume;
  Tensor h = convolve(ctx, conv_in_, norm_silu(ctx, norm_in_, std::exchange(volume, {})), edge, "conv_in.3");
  std::vector<Tensor> skips = {h};
  for (const Down& level : down_) {
    h = res(ctx, level.res, std::move(h), {}, edge);
    skips.push_back(h);
    if (level.downsample.w.bias) {
      h = downsample(ctx, level.downsample, h, edge);
      edge /= 2;
      skips.push_back(h);
    }
  }
  h = res(ctx, mid_, std::move(h), {}, edge);
  for (std::size_t i = 0; i < up_.size(); ++i) {
    for (const ResBlock& block : up_[i].res) {
      Tensor skip = std::move(skips.back());
      skips.pop_back();
      h = res(ctx, block, std::move(h), std::move(skip), edge);
    }
    if (i + 1 < up_.size()) {
      h = upsample(ctx, h, edge);
      edge *= 2;
    }
  }
  return convolve(ctx, conv_out_, norm_silu(ctx, norm_out_, std::exchange(h, {})), edge, "conv_out");
}

}  // namespace vsplat
