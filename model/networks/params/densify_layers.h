// The declaration of the densifier's layers, like network_layers.h for VS-Splat's network: `dec` of the published state
// dict. Its LayerNorms have no weights.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/densify_config.h"
#include "model/networks/params/layer_builder.h"

namespace vsplat {

template <class Make>
struct DensifyBlock {
  typename Make::Conv conv;
  typename Make::Linear mixed, qkv, proj, fc1, fc2;

  DensifyBlock(const LayerBuilder<Make>& build, long ch, long ratio) {
    conv = build.submanifold("cpe.0", ch, ch, 3);
    mixed = build.linear("cpe.1", ch, ch);
    qkv = build.linear("attn.qkv", ch, 3 * ch);
    proj = build.linear("attn.proj", ch, ch);
    fc1 = build.linear("mlp.0.fc1", ch, ratio * ch);
    fc2 = build.linear("mlp.0.fc2", ratio * ch, ch);
  }
};

template <class Make>
struct DensifyLevel {
  std::vector<DensifyBlock<Make>> blocks;
  typename Make::Linear offset1, offset2, skip, feature1, feature2;  // for the children
  typename Make::Linear sure1, sure2;                                // empty at the last level
  typename Make::Linear head1, head2;

  // `sh_count`: spherical harmonics of a Gaussian.
  DensifyLevel(const LayerBuilder<Make>& build, const DensifyConfig& c, std::size_t s, long sh_count) {
    const bool last = s + 1 == c.levels();
    const long ch = c.channels[s], out = c.channels[last ? s : s + 1];
    for (int i = 0; i < c.depths[s]; ++i) blocks.emplace_back(build.in("block" + std::to_string(i)), ch, c.mlp_ratio);
    const LayerBuilder<Make> up = build.in("up");
    offset1 = up.linear("delta_x.0", ch, ch);
    offset2 = up.linear("delta_x.2", ch, 3L * c.upscale[s]);
    skip = up.linear("skip", ch, out);
    feature1 = up.linear("delta_f.1", ch + 6L * c.frequencies, ch);
    feature2 = up.linear("delta_f.3", ch, out);
    const auto head = [&] {
      head1 = build.linear("head.feat2attr.0", out, out);
      head2 = build.linear("head.feat2attr.2", out, 8 + 3 * sh_count);
    };
    if (c.residual) head();
    if (!last) {
      sure1 = build.linear("mask.net.0", out, out);
      sure2 = build.linear("mask.net.2", out, 1);
    }
    if (!c.residual) head();
  }
};

template <class Make>
struct DensifyLayers {
  std::vector<DensifyLevel<Make>> levels;

  DensifyLayers(const LayerBuilder<Make>& network, const DensifyConfig& c, long sh_count) {
    const LayerBuilder<Make> build = network.in("dec");
    for (std::size_t s = 0; s < c.levels(); ++s) levels.emplace_back(build.in(std::to_string(s)), c, s, sh_count);
  }
};

}  // namespace vsplat
