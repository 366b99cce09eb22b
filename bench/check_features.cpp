// Encoder and modulation.
#include "bench/layer_check.h"
#include "bench/sums.h"
#include "model/diagnose/selftest/reference/patch_embed.h"
#include "model/diagnose/selftest/reference/plucker.h"
#include "model/diagnose/selftest/reference/position_resample.h"
#include "model/networks/layers/vit.h"
#include "model/networks/vsplat/pose_modulation.h"

namespace vsplat::bench {

void ModelCheck::check_features() {
  const long c = config_.vit_dim, tokens = 1L + config_.tokens() * config_.tokens();
  Floats last;
  Tensor out;
  {
    const Vit encoder(ctx_, config_.encoder_sizes(), in_.weights);
    Vit::Saved saved;
    out = encoder.forward(ctx_, in_.images, &saved);
    check_patches(read(saved.blocks.at(0).x), tokens, c);
    for (std::size_t i = 0; i < saved.blocks.size(); ++i) {
      last = read(i + 1 < saved.blocks.size() ? saved.blocks[i + 1].x : saved.last);
      check_block("blocks." + std::to_string(i), saved.blocks[i], last, tokens, c);
    }
  }
  const Layers model = layers_.in("encoder").in("model");
  const Floats normed = read(out);
  sampled("encoder: norm", normed, [&](long i) { return NormedRow(model, "norm", last, i / c)(i % c); });

  const PoseModulation modulation(ctx_, config_, in_.weights);
  PoseModulation::Saved saved;
  const Floats features = read(modulation.forward(ctx_, out, in_.views, &saved));
  const Floats rays = read(saved.rays), hidden = read(saved.hidden), film = read(saved.film);
  const Layers by = layers_.in("dir_norm");
  const long patches = tokens - 1;
  sampled("modulation: rays", rays, [&](long i) { return ray(i / kRayValues, i % kRayValues); });
  sampled("modulation: mlp.0", hidden, [&](long i) {
    return linear(by, "mlp.0", i % c, [&](long k) { return static_cast<double>(rays[u(i / c * kRayValues + k)]); });
  });
  sampled("modulation: mlp.2", film, [&](long i) {
    return linear(by, "mlp.2", i % (2 * c),
                  [&](long k) { return ref::silu(static_cast<double>(hidden[u(i / (2 * c) * c + k)])); });
  });
  sampled("modulation", features, [&](long i) {
    const long row = i / c, token = row / patches * tokens + 1 + row % patches;
    const double shift = film[u(2 * row * c + i % c)], scale = film[u((2 * row + 1) * c + i % c)];
    return NormedRow(by, "norm", normed, token)(i % c) * (1 + scale) + shift;
  });
  same("features", features, tap("features"));
}

void ModelCheck::check_patches(const Floats& got, long tokens, long c) {
  const Layers model = layers_.in("encoder").in("model");
  const Floats &stored = model.at("pos_embed"), &weight = model.at("patch_embed.proj.weight"),
               &bias = model.at("patch_embed.proj.bias"), &first = model.at("cls_token");
  const auto from = u(config_.vit_pos_grid), to = u(config_.tokens());
  const long p = config_.patch, edge = config_.image;
  const auto position = [&](std::size_t at, long n) {
    double sum = 0, total = 0;
    for (std::size_t i = 0; i < from * from; ++i) {
      const double w =
          ref::resample_weight(at / to, i / from, from, to) * ref::resample_weight(at % to, i % from, from, to);
      sum += w * static_cast<double>(stored[(1 + i) * u(c) + u(n)]);
      total += w;
    }
    return sum / total;
  };
  sampled("encoder: patch_embed", got, [&](long i) {
    const long n = i % c, view = i / c / tokens, token = i / c % tokens;
    if (token == 0) return static_cast<double>(stored[u(n)]) + static_cast<double>(first[u(n)]);
    const long y0 = (token - 1) / config_.tokens() * p, x0 = (token - 1) % config_.tokens() * p;
    double sum = static_cast<double>(bias[u(n)]) + position(u(token - 1), n);
    for (long k = 0; k < 3 * p * p; ++k) {
      const long y = y0 + k / p % p, x = x0 + k % p, channel = k / (p * p);
      const double pixel = in_.pictures[u(((view * edge + y) * edge + x) * 3 + channel)];
      sum += static_cast<double>(weight[u(n * 3 * p * p + k)]) * ref::normalised(pixel, u(channel));
    }
    return sum;
  });
}

void ModelCheck::check_block(const std::string& name, const BlockSaved& saved, const Floats& out, long tokens, long c) {
  const Layers block = layers_.in("encoder").in("model").in(name);
  const Floats x = read(saved.x), qkv = read(saved.qkv), attended = read(saved.attended), middle = read(saved.middle),
               hidden = read(saved.hidden);
  const long wide = static_cast<long>(block.at("mlp.fc1.bias").size());
  sampled(name + ": qkv", qkv,
          [&](long i) { return linear(block, "attn.qkv", i % (3 * c), NormedRow(block, "norm1", x, i / (3 * c))); });
  sampled(name + ": attention", attended,
          [&](long i) { return attention_at(qkv, tokens, config_.vit_heads, c, i / c, i % c); });
  sampled(name + ": proj", middle, [&](long i) {
    return static_cast<double>(x[u(i)]) +
           linear(block, "attn.proj", i % c, [&](long k) { return static_cast<double>(attended[u(i / c * c + k)]); });
  });
  sampled(name + ": fc1", hidden,
          [&](long i) { return linear(block, "mlp.fc1", i % wide, NormedRow(block, "norm2", middle, i / wide)); });
  sampled(name + ": fc2", out, [&](long i) {
    return static_cast<double>(middle[u(i)]) + linear(block, "mlp.fc2", i % c, [&](long k) {
             return ref::gelu(static_cast<double>(hidden[u(i / c * wide + k)]));
           });
  });
}

double ModelCheck::ray(long row, long value) const {
  const long t = config_.tokens(), patch = row % (t * t);
  Eigen::Vector3d direction, moment;
  const auto centre = [&](long at) { return (static_cast<double>(at) + 0.5) * config_.patch; };
  ref::plucker(in_.cameras[u(row / (t * t))], centre(patch % t), centre(patch / t), direction, moment);
  return ref::real_sh3(value < kRayValues / 2 ? direction : moment)[u(value % (kRayValues / 2))];
}

}  // namespace vsplat::bench
