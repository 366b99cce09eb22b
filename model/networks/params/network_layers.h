// The declaration of VS-Splat's network: each stage's layers with their names and sizes, in the order of the state
// dict. The stages (model/networks/vsplat) hold them loaded; parameters() lists them. `Make` as in LayerBuilder.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/config_fields.h"
#include "model/networks/params/layer_builder.h"

namespace vsplat {

inline constexpr int kPositionValues = 63;  // x, then sine and cosine of 10 octaves, three values each
inline constexpr int kRayValues = 32;       // spherical harmonics to degree 3 of a ray's direction and moment

// A transformer block: y = x + attention(norm1(x)), then y + MLP(norm2(y)).
template <class Make>
struct TransformerBlock {
  typename Make::Learnt gamma1, gamma2;  // factors on the results of proj and fc2; DINOv3 only
  typename Make::LayerNorm norm1;
  typename Make::Learnt q_bias, v_bias;  // if qkv has no bias of its own; DINOv3 only
  typename Make::Linear qkv;
  typename Make::ScaledLinear proj;
  typename Make::LayerNorm norm2;
  typename Make::Linear fc1;
  typename Make::ScaledLinear fc2;

  // `hidden`: the MLP's width.
  TransformerBlock(const LayerBuilder<Make>& build, long dim, long hidden)
      : norm1(build.layer_norm("norm1", dim)),
        qkv(build.linear("attn.qkv", dim, 3 * dim)),
        proj(build.scaled_linear("attn.proj", dim, dim, nullptr)),
        norm2(build.layer_norm("norm2", dim)),
        fc1(build.linear("mlp.fc1", dim, hidden)),
        fc2(build.scaled_linear("mlp.fc2", hidden, dim, nullptr)) {}

  // For DINOv3.
  TransformerBlock(const LayerBuilder<Make>& build, const EncoderSizes& c) {
    const long dim = c.vit_dim;
    gamma1 = build.scale("gamma_1", dim), gamma2 = build.scale("gamma_2", dim);
    norm1 = build.layer_norm("norm1", dim);
    if (c.qkv_bias) q_bias = build.bias("attn.q_bias", dim), v_bias = build.bias("attn.v_bias", dim);
    qkv = build.linear_unbiased("attn.qkv", dim, 3 * dim);
    proj = build.scaled_linear("attn.proj", dim, dim, &gamma1);
    norm2 = build.layer_norm("norm2", dim);
    fc1 = build.linear("mlp.fc1", dim, 4 * dim);
    fc2 = build.scaled_linear("mlp.fc2", 4 * dim, dim, &gamma2);
  }
};

// The encoder: a vision transformer, DINO's or DINOv3's.
template <class Make>
struct EncoderLayers {
  typename Make::Positions positions;            // DINO only, including the class token
  typename Make::Learnt class_token, registers;  // DINOv3 only, which adds no positions
  typename Make::Linear patches;
  std::vector<TransformerBlock<Make>> blocks;
  typename Make::LayerNorm norm;

  // `network` with the name of the encoder's module.
  EncoderLayers(const LayerBuilder<Make>& network, const EncoderSizes& c) {
    const LayerBuilder<Make> build = network.in("model");
    const long dim = c.vit_dim;
    if (!c.dinov3) positions = build.positions("cls_token", "pos_embed", c.vit_pos_grid, c.tokens(), dim);
    if (c.dinov3) class_token = build.tokens("cls_token", 1, dim);
    if (c.registers > 0) registers = build.tokens("reg_token", c.registers, dim);
    patches = build.patches("patch_embed.proj", 3, dim, c.patch);
    for (int i = 0; i < c.vit_depth; ++i) {
      const LayerBuilder<Make> block = build.in("blocks").in(std::to_string(i));
      if (c.dinov3)
        blocks.emplace_back(block, c);
      else
        blocks.emplace_back(block, dim, 4 * dim);
    }
    norm = build.layer_norm("norm", dim);
  }
};

// The ray predictor on the encoder's features: names and layers of SHARE's code, after `reduce`.
template <class Make>
struct RayPredictorLayers {
  struct Reduce {  // norm, SiLU, 1x1 convolution
    typename Make::GroupNorm norm;
    typename Make::Linear conv;
  };
  struct Matching {  // attention, merge, norm; across views then an MLP and its norm
    typename Make::Linear q, k, v, merge;
    typename Make::LayerNorm norm1;
    typename Make::Linear mlp0, mlp2;
    typename Make::LayerNorm norm2;
  };
  struct MatchBlock {
    Matching self, cross;
  };
  std::vector<Reduce> reduce;
  std::vector<MatchBlock> matching;
  typename Make::Linear pre_conv;   // may be empty
  typename Make::Learnt view_code;  // [max_views, view_dim]; may be empty
  typename Make::Linear embedder;
  std::vector<TransformerBlock<Make>> blocks;
  typename Make::LayerNorm norm;
  typename Make::Linear head;

  RayPredictorLayers(const LayerBuilder<Make>& network, const Config& c) {
    if (!c.predicts_poses()) return;
    const LayerBuilder<Make> build = network.in("share"), heads = build.like_heads();
    const long dim = c.share_dim, rays = c.share_ray_dim;
    if (c.share_view_dim > 0) view_code = build.learnt("view_pos_emb", {c.share_max_views, c.share_view_dim}, 1);
    const long widths[] = {c.vit_dim, c.share_reduce[0], c.share_reduce[1], dim};
    for (int i = 0; i < 3; ++i)
      reduce.push_back({build.group_norm("reduce." + std::to_string(3 * i), widths[i], c.groups),
                        build.pixelwise("reduce." + std::to_string(3 * i + 2), widths[i], widths[i + 1])});
    for (int i = 0; i < c.share_match_layers; ++i) {
      const LayerBuilder<Make> block = heads.in("transformer.layers").in(std::to_string(i));
      MatchBlock& b = matching.emplace_back();
      b.self = match(block.in("self_attn"), dim, 0);
      b.cross = match(block.in("cross_attn_ffn"), dim, 2 * dim * c.share_match_mlp);
    }
    if (c.share_pre_conv) pre_conv = build.pixelwise("pre_conv", dim, dim);
    const LayerBuilder<Make> second = heads.in("ray_predictor");
    embedder = second.pixelwise("x_embedder.proj", dim + c.share_view_dim, rays);
    for (int i = 0; i < c.share_ray_layers; ++i)
      blocks.emplace_back(second.in("blocks").in(std::to_string(i)), rays, static_cast<long>(c.share_ray_mlp * rays));
    norm = second.layer_norm("final_layer.norm_final", rays);
    head = second.linear("final_layer.linear", rays, 6);
  }

 private:
  static Matching match(const LayerBuilder<Make>& build, long dim, long hidden) {
    Matching out;
    out.q = build.linear_unbiased("q_proj", dim, dim);
    out.k = build.linear_unbiased("k_proj", dim, dim);
    out.v = build.linear_unbiased("v_proj", dim, dim);
    out.merge = build.linear_unbiased("merge", dim, dim);
    out.norm1 = build.layer_norm("norm1", dim);
    if (hidden == 0) return out;
    out.mlp0 = build.linear_unbiased("mlp.0", 2 * dim, hidden);
    out.mlp2 = build.linear_unbiased("mlp.2", hidden, dim);
    out.norm2 = build.layer_norm("norm2", dim);
    return out;
  }
};

// The modulation of the encoder's tokens by their rays.
template <class Make>
struct ModulationLayers {
  typename Make::LayerNorm norm;
  typename Make::Linear first, second;

  ModulationLayers(const LayerBuilder<Make>& network, const Config& c) {
    const LayerBuilder<Make> build = network.in("dir_norm");
    const long dim = c.vit_dim;
    norm = build.layer_norm("norm", dim);
    first = build.linear("mlp.0", kRayValues, dim);
    second = build.linear("mlp.2", dim, 2 * dim);
  }
};

// The convolution of the lifted features: of the mean and the variance over the views.
template <class Make>
struct LiftingLayers {
  typename Make::SplitLinear mean_and_variance;

  LiftingLayers(const LayerBuilder<Make>& network, const Config& c) {
    mean_and_variance =
        network.in("volume_network").split_pointwise("conv_in.0", c.vit_dim, c.vit_dim, 4L * c.volume_ch);
  }
};

// norm-SiLU-conv, norm-SiLU-conv, plus x or a 1x1x1 of x.
template <class Make>
struct VolumeResBlock {
  typename Make::GroupNorm norm1;
  typename Make::Conv conv1;
  typename Make::GroupNorm norm2;
  typename Make::Conv conv2;
  typename Make::Linear shortcut;  // empty if the width does not change

  VolumeResBlock() = default;
  VolumeResBlock(const LayerBuilder<Make>& build, long in, long out, int groups) {
    norm1 = build.group_norm("norm1", in, groups);
    conv1 = build.conv3d("conv1", in, out);
    norm2 = build.group_norm("norm2", out, groups);
    conv2 = build.conv3d("conv2", out, out);
    if (in != out) shortcut = build.pointwise("nin_shortcut", in, out);
  }
};

// The light 3D U-Net.
template <class Make>
struct VolumeLayers {
  using ResBlock = VolumeResBlock<Make>;
  struct Down {
    ResBlock res;
    typename Make::Conv downsample;  // empty at the last level
  };
  struct Up {
    ResBlock res[2];
  };
  typename Make::GroupNorm norm_in;
  typename Make::Conv conv_in;
  std::vector<Down> down;
  ResBlock mid;
  std::vector<Up> up;
  typename Make::GroupNorm norm_out;
  typename Make::Conv conv_out;

  VolumeLayers(const LayerBuilder<Make>& network, const Config& c) {
    const LayerBuilder<Make> build = network.in("volume_network");
    const long ch = c.volume_ch;
    norm_in = build.group_norm("conv_in.1", 4 * ch, c.groups);
    conv_in = build.conv3d("conv_in.3", 4 * ch, ch);
    const std::size_t levels = c.volume_mult.size();
    std::vector<long> skips = {ch};
    long width = ch;
    for (std::size_t i = 0; i < levels; ++i) {
      const LayerBuilder<Make> level = build.in("down_blocks").in(std::to_string(i));
      const long out = ch * c.volume_mult[i];
      down.push_back({ResBlock(level.in("res.0"), width, out, c.groups), {}});
      skips.push_back(width = out);
      if (i + 1 < levels) {
        down.back().downsample = level.conv3d_down("downsample.conv", width, width);
        skips.push_back(width);
      }
    }
    mid = ResBlock(build.in("mid.0"), width, width, c.groups);
    for (std::size_t i = 0; i < levels; ++i) {
      const LayerBuilder<Make> level = build.in("up_blocks").in(std::to_string(i)).in("res");
      const long out = ch * c.volume_mult[levels - 1 - i];
      Up& blocks = up.emplace_back();
      for (int j = 0; j < 2; ++j) {
        blocks.res[j] = ResBlock(level.in(std::to_string(j)), width + skips.back(), out, c.groups);
        skips.pop_back();
        width = out;
      }
    }
    norm_out = build.group_norm("norm_out", width, c.groups);
    conv_out = build.conv3d("conv_out", width, ch);
  }
};

// The sparse network over the selected voxels.
template <class Make>
struct RefinementLayers {
  // norm-SiLU-conv, norm-SiLU-conv, plus x.
  struct ResBlock {
    typename Make::GroupNorm norm1;
    typename Make::Conv conv1;
    typename Make::GroupNorm norm2;
    typename Make::Conv conv2;
  };
  typename Make::Linear comp_linear;
  typename Make::Conv conv_in;
  std::vector<ResBlock> blocks;
  typename Make::GroupNorm norm_out;
  typename Make::Conv conv_out;

  RefinementLayers(const LayerBuilder<Make>& network, const Config& c) {
    const LayerBuilder<Make> build = network.in("voxel_network").used_if(c.levels == "fine");
    const long ch = c.voxel_ch, projected = c.projected_ch();
    comp_linear = build.linear("comp_linear", projected + c.volume_ch + kPositionValues, ch);
    conv_in = build.submanifold("conv_in", ch, ch, 3);
    for (int i = 0; i < 2 * c.voxel_levels; ++i) {
      const LayerBuilder<Make> level = build.in("conv_blocks").in(std::to_string(i / 2));
      const LayerBuilder<Make> block = level.in("res").in(std::to_string(i % 2));
      blocks.push_back({block.group_norm("norm1.group_norm", ch, c.groups), block.submanifold("conv1", ch, ch, 3),
                        block.group_norm("norm2.group_norm", ch, c.groups), block.submanifold("conv2", ch, ch, 3)});
    }
    norm_out = build.group_norm("norm_out.group_norm", ch + projected, c.groups);
    conv_out = build.submanifold("conv_out", ch + projected, c.fine_dim, c.refine_out_kernel);
  }
};

// Per voxel a confidence and a coarse primitive.
template <class Make>
struct CoarseHeadLayers {
  typename Make::Mlp3 act_predictor, coarse_predictor;

  CoarseHeadLayers(const LayerBuilder<Make>& network, const Config& c) {
    const LayerBuilder<Make> build = network.in("predictor");
    const bool asks_confidence = c.levels != "coarse" && c.selection != "opacity";
    act_predictor = build.used_if(asks_confidence).mlp3("act_predictor", c.volume_ch, 1);
    coarse_predictor = build.mlp3("coarse_predictor", c.volume_ch, c.primitive_size());
  }
};

// Per selected voxel M fine primitives and a correction of the coarse one.
template <class Make>
struct FineHeadLayers {
  typename Make::Mlp3 fine_predictor, update_predictor;

  FineHeadLayers(const LayerBuilder<Make>& network, const Config& c) {
    const LayerBuilder<Make> build = network.in("predictor").used_if(c.levels == "fine");
    fine_predictor = build.mlp3("fine_predictor", c.fine_dim, static_cast<long>(c.fine_count) * c.primitive_size());
    update_predictor = build.mlp3("update_predictor", c.fine_dim, 1 + 3L * c.sh_count());
  }
};

// Initial offsets of the fine primitives within their voxel: the state dict's first entry, separate from the heads that
// use it.
template <class Make>
struct FinePlaceLayers {
  typename Make::Fixed div_offset;  // [M, 3]

  FinePlaceLayers(const LayerBuilder<Make>& network, const Config& c) {
    div_offset = network.fixed("div_offset", {c.fine_count, 3}, Init::sobol);
  }
};

}  // namespace vsplat
