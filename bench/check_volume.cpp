// Lifting and the dense network.
#include "bench/layer_check.h"
#include "model/diagnose/selftest/reference/project_features.h"
#include "model/networks/vsplat/fused_lift.h"

namespace vsplat::bench {

void ModelCheck::check_volume() {
  const long c = config_.vit_dim, wide = 4L * config_.volume_ch, t = config_.tokens();
  const Floats& features = tap("features");
  const Lifting lifting(ctx_, config_, in_.weights);
  Tensor lifted =
      lifting.forward(ctx_, upload("features", {static_cast<long>(in_.cameras.size()), t, t, c}), in_.views);
  const Layers network = layers_.in("volume_network");
  sampled("lifting", read(lifted), [&](long i) {
    std::vector<std::vector<double>> samples(in_.cameras.size());
    for (std::size_t v = 0; v < samples.size(); ++v)
      ref::sample_view(features, t, c, static_cast<long>(v), in_.cameras[v], config_.image, config_.sample_half_pixel,
                       centre_of(i / wide), samples[v]);
    return linear(network, "conv_in.0", i % wide, [&](long k) {
      double mean = 0, variance = 0;
      for (const auto& s : samples) mean += s[u(k % c)] / static_cast<double>(samples.size());
      for (const auto& s : samples) variance += std::pow(s[u(k % c)] - mean, 2) / static_cast<double>(samples.size());
      return k < c ? mean : variance;
    });
  });

  const VolumeNetwork volume(ctx_, config_, in_.weights);
  VolumeNetwork::Saved saved;
  const Floats out = read(volume.forward(ctx_, std::move(lifted), &saved));
  same("volume", out, tap("volume"));
  long edge = config_.volume;
  const auto given = [&](const VolumeNetwork::ResSaved& block) { return read(block.norm1.rows.x0); };
  check_conv(network, "conv_in.3", checked_norm(network, "conv_in.1", saved.norm_in.rows), edge,
             given(saved.down.at(0)));
  for (std::size_t i = 0; i < saved.down.size(); ++i) {
    const Layers level = network.in("down_blocks." + std::to_string(i));
    const bool halved = i < saved.downsampled.size();
    check_res(level.in("res.0"), saved.down[i], edge, halved ? read(saved.downsampled[i]) : given(saved.mid));
    if (!halved) continue;
    check_downsampling(level, read(saved.downsampled[i]), edge,
                       given(i + 1 < saved.down.size() ? saved.down[i + 1] : saved.mid));
    edge /= 2;
  }
  check_res(network.in("mid.0"), saved.mid, edge, given(saved.up.at(0)));
  for (std::size_t i = 0; i < saved.up.size(); ++i) {
    const Layers block = network.in("up_blocks." + std::to_string(i / 2)).in("res." + std::to_string(i % 2));
    const bool end = i + 1 == saved.up.size(), doubled = i % 2 == 1 && !end;
    check_res(block, saved.up[i], edge, end ? read(saved.norm_out.rows.x0) : given(saved.up[i + 1]), doubled);
    if (doubled) edge *= 2;
  }
  check_conv(network, "conv_out", checked_norm(network, "norm_out", saved.norm_out.rows), edge, out);
}

double ModelCheck::convolved(const Layers& layers, const std::string& name, const ref::Rows& in, long edge, long voxel,
                             long n) const {
  const Floats &w = layers.at(name + ".weight"), &bias = layers.at(name + ".bias");
  const long channels = in.c0 + in.c1;
  double sum = static_cast<double>(bias[u(n)]);
  for (long tap = 0; tap < 27; ++tap) {
    const long x = voxel / (edge * edge) + tap / 9 - 1, y = voxel / edge % edge + tap / 3 % 3 - 1,
               z = voxel % edge + tap % 3 - 1;
    if (std::min({x, y, z}) < 0 || std::max({x, y, z}) >= edge) continue;
    for (long c = 0; c < channels; ++c)
      sum += static_cast<double>(w[u((n * channels + c) * 27 + tap)]) * in.at((x * edge + y) * edge + z, c);
  }
  return sum;
}

void ModelCheck::check_conv(const Layers& layers, const std::string& name, const ref::Rows& in, long edge,
                            const Floats& out) {
  const auto wide = static_cast<long>(layers.at(name + ".bias").size());
  sampled(layers.prefix + name, out, [&](long i) { return convolved(layers, name, in, edge, i / wide, i % wide); });
}

void ModelCheck::check_res(const Layers& block, const VolumeNetwork::ResSaved& saved, long edge, const Floats& out,
                           bool doubled) {
  const ref::Rows first = checked_norm(block, "norm1", saved.norm1.rows),
                  second = checked_norm(block, "norm2", saved.norm2.rows);
  check_conv(block, "conv1", first, edge, second.x0);
  const auto at = [&](long voxel, long n) {
    const auto given = [&](long c) {
      return static_cast<double>(c < first.c0 ? first.x0[u(voxel * first.c0 + c)]
                                              : first.x1[u(voxel * first.c1 + c - first.c0)]);
    };
    const double residual = block.has("nin_shortcut.bias") ? linear(block, "nin_shortcut", n, given) : given(n);
    return residual + convolved(block, "conv2", second, edge, voxel, n);
  };
  const long wide = second.c0;
  if (!doubled) return sampled(block.prefix + "conv2", out, [&](long i) { return at(i / wide, i % wide); });
  const long twice = 2 * edge;
  sampled(block.prefix + "conv2, upsampled", out, [&](long i) {
    const long voxel = i / wide, place[3] = {voxel / (twice * twice), voxel / twice % twice, voxel % twice};
    double sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      double weight = 1;
      long from = 0;
      for (int axis = 0; axis < 3; ++axis) {
        const double where = std::max(0.0, (static_cast<double>(place[axis]) + 0.5) / 2 - 0.5);
        const auto low = static_cast<long>(where);
        const bool high = corner >> axis & 1;
        weight *= high ? where - static_cast<double>(low) : 1 - where + static_cast<double>(low);
        from = from * edge + std::min(low + (high ? 1 : 0), edge - 1);
      }
      if (weight > 0) sum += weight * at(from, i % wide);
    }
    return sum;
  });
}

void ModelCheck::check_downsampling(const Layers& level, const Floats& in, long edge, const Floats& out) {
  const Floats &w = level.at("downsample.conv.weight"), &bias = level.at("downsample.conv.bias");
  const long wide = static_cast<long>(bias.size()), channels = static_cast<long>(w.size()) / (8 * wide),
             half = edge / 2;
  sampled(level.prefix + "downsample", out, [&](long i) {
    const long voxel = i / wide, n = i % wide;
    double sum = static_cast<double>(bias[u(n)]);
    for (long tap = 0; tap < 8; ++tap) {
      const long x = 2 * (voxel / (half * half)) + tap / 4, y = 2 * (voxel / half % half) + tap / 2 % 2,
                 z = 2 * (voxel % half) + tap % 2;
      for (long c = 0; c < channels; ++c)
        sum += static_cast<double>(w[u((n * channels + c) * 8 + tap)]) *
               static_cast<double>(in[u(((x * edge + y) * edge + z) * channels + c)]);
    }
    return sum;
  });
}

}  // namespace vsplat::bench
