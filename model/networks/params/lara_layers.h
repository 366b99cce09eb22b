// The declaration of LaRa's layers, like network_layers.h for VS-Splat's: each stage's layers with their names and
// sizes, in the order of the published state dict. The encoder is VS-Splat's (EncoderLayers), under "img_encoder".
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/lara_config.h"
#include "model/networks/params/layer_builder.h"
#include "model/networks/params/network_layers.h"

namespace vsplat {

// A multi-head attention without biases.
template <class Make>
struct LaraAttention {
  typename Make::Linear q, k, v, out;

  LaraAttention() = default;
  LaraAttention(const LayerBuilder<Make>& build, long dim, long seen) {
    q = build.matrix("q_proj_weight", dim, dim);
    k = build.matrix("k_proj_weight", seen, dim);
    v = build.matrix("v_proj_weight", seen, dim);
    out = build.matrix("out_proj.weight", dim, dim);
  }
};

// The embedding of a view's number, appended to its lifted features: the state dict's first entry.
template <class Make>
struct LaraViewLayers {
  typename Make::Learnt embedding;  // [1, slots, E, 1, 1, 1]

  LaraViewLayers(const LayerBuilder<Make>& network, const LaraConfig& c) {
    embedding = network.learnt("view_embed", {1, c.view_slots, c.view_ch, 1, 1, 1}, c.view_ch);
  }
};

// SiLU on the rays, then a single Linear.
template <class Make>
struct LaraModulationLayers {
  typename Make::LayerNorm norm;
  typename Make::Linear film;

  LaraModulationLayers(const LayerBuilder<Make>& network, const LaraConfig& c) {
    const LayerBuilder<Make> build = network.in("dir_norm");
    norm = build.layer_norm("norm", c.vit_dim);
    film = build.linear("mlp.1", kRayValues, 2L * c.vit_dim);
  }
};

// The volume transformer.
template <class Make>
struct LaraVolumeLayers {
  struct Layer {
    typename Make::LayerNorm norm1;
    LaraAttention<Make> attention;
    typename Make::Conv conv;
    typename Make::LayerNorm norm2, norm3;
    typename Make::Linear fc1, fc2;
  };
  typename Make::Learnt start;  // [1, C, R, R, R]
  std::vector<Layer> layers;
  typename Make::LayerNorm norm;
  typename Make::ConvUp up;

  LaraVolumeLayers(const LayerBuilder<Make>& network, const LaraConfig& c) {
    const LayerBuilder<Make> build = network.in("vol_decoder");
    const long ch = c.volume_ch, r = c.volume;
    start = build.learnt("pos_embed", {1, ch, r, r, r}, ch);
    for (int i = 0; i < c.layers; ++i) {
      const LayerBuilder<Make> one = build.in("layers").in(std::to_string(i));
      Layer& layer = layers.emplace_back();
      layer.norm1 = one.layer_norm("norm1", ch);
      layer.attention = LaraAttention<Make>(one.in("cross_attn"), ch, c.lifted_ch());
      layer.conv = one.conv3d_unbiased("cnn", ch, ch);
      layer.norm2 = one.layer_norm("norm2", ch);
      layer.norm3 = one.layer_norm("norm3", ch);
      layer.fc1 = one.linear("mlp.0", ch, 2 * ch);
      layer.fc2 = one.linear("mlp.3", 2 * ch, ch);
    }
    norm = build.layer_norm("norm", ch);
    up = build.conv3d_up("deconv", ch, c.out_ch);
  }
};

// From a voxel's feature to K primitives.
template <class Make>
struct LaraCoarseLayers {
  std::vector<typename Make::Linear> mlp;

  LaraCoarseLayers(const LayerBuilder<Make>& network, const LaraConfig& c) {
    const LayerBuilder<Make> build = network.in("decoder").in("mlp_coarse");
    mlp.push_back(build.head("0", c.out_ch, c.out_ch));
    mlp.push_back(build.head("2", c.out_ch, c.out_ch));
    mlp.push_back(build.head("4", c.out_ch, static_cast<long>(c.primitives) * c.primitive_size()));
  }
};

// From the views at a primitive's position to its colours.
template <class Make>
struct LaraFineLayers {
  static constexpr long kSeen = 8;  // values per view
  typename Make::LayerNorm norm;
  LaraAttention<Make> attention;
  std::vector<typename Make::Linear> mlp;

  LaraFineLayers(const LayerBuilder<Make>& network, const LaraConfig& c) {
    const LayerBuilder<Make> build = network.in("decoder");
    norm = build.layer_norm("norm", c.out_ch);
    attention = LaraAttention<Make>(build.in("cross_att"), c.out_ch, kSeen);
    mlp.push_back(build.head("mlp_fine.0", c.out_ch, c.fine_hidden));
    mlp.push_back(build.head("mlp_fine.2", c.fine_hidden, c.fine_features + 3L * c.sh_count()));
  }
};

}  // namespace vsplat
