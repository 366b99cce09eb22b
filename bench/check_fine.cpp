// Heads, refinement and what they make: both levels' Gaussians.
#include <unordered_map>

#include "bench/layer_check.h"
#include "model/diagnose/selftest/reference/position_encoding.h"
#include "model/diagnose/selftest/reference/project_features.h"
#include "model/diagnose/selftest/reference/select.h"
#include "model/networks/vsplat/voxel_refiner.h"

namespace vsplat::bench {

double ModelCheck::volume_at(long voxel, long c) const { return tap("volume")[u(voxel * config_.volume_ch + c)]; }

void ModelCheck::check_coarse() {
  const Layers heads = layers_.in("predictor");
  const long size = config_.primitive_size();
  const double voxel = 1.0 / config_.volume;
  const auto in = [&](long row) { return [this, row](long c) { return volume_at(row, c); }; };
  sampled("logits", tap("logits"), [&](long i) { return mlp3(heads, "act_predictor", 0, in(i)); });
  check_gaussians("coarse", [&](long k) {
    std::vector<double> raw;
    for (long n = 0; n < size; ++n) raw.push_back(mlp3(heads, "coarse_predictor", n, in(k)));
    const Eigen::Vector3d anchor = centre_of(k);
    ref::GaussianLists out;
    ref::decode(raw.data(), anchor.data(), voxel / 4, voxel, 3L * config_.sh_count(), out);
    out.opacities[0] = ref::select(config_.selection, tap("logits")[u(k)], 0, out.opacities[0],
                                   ForwardOptions().temperature, config_.opacity_threshold)
                           .refined;
    return out;
  });
}

double ModelCheck::coarse(const char* part, long p, long i, long each) const {
  return tap(std::string("coarse.") + part)[u(in_.selection[u(p)] * each + i)];
}

void ModelCheck::check_refined() {
  const long p = static_cast<long>(in_.selection.size()), t = config_.tokens(), c = config_.vit_dim,
             own = config_.volume_ch + kPositionValues, r = config_.volume;
  Floats means;
  for (long i = 0; i < 3 * p; ++i) means.push_back(static_cast<float>(coarse("means", i / 3, i % 3, 3)));
  const Refinement refinement(ctx_, config_, in_.weights);
  Refinement::Saved saved;
  const Refinement::Output out =
      refinement.forward(ctx_,
                         {upload("volume", {config_.voxels(), config_.volume_ch}),
                          upload("features", {static_cast<long>(in_.cameras.size()), t, t, c}), &in_.views,
                          ctx_.upload({p, 3}, means), ctx_.upload({p}, in_.selection, Type::i32)},
                         &saved);
  same("refined", read(out.refined), tap("refined"));
  Floats projected;
  if (config_.use_projected) {
    projected = read(out.projected);
    same("projected, once more", projected, tap("projected"));
    ref::ProjectFeaturesCase of;
    of.t = t, of.channels = c, of.cameras = in_.cameras, of.image = config_.image;
    of.half_pixel = config_.sample_half_pixel, of.by_distance = config_.view_weight == "distance";
    of.features.assign(tap("features").begin(), tap("features").end());
    sampled("projected", projected, [&](long i) {
      of.points = {coarse("means", i / c, 0, 3), coarse("means", i / c, 1, 3), coarse("means", i / c, 2, 3)};
      return ref::project_features(of)[u(i % c)];
    });
  }
  const Floats beside = read(saved.volume_position), linear_out = read(saved.linear);
  sampled("volume and position", beside, [&](long i) {
    const long row = i / own, n = i % own;
    if (n < config_.volume_ch) return volume_at(in_.selection[u(row)], n);
    const std::vector<double> point = {coarse("means", row, 0, 3), coarse("means", row, 1, 3),
                                       coarse("means", row, 2, 3)};
    return ref::position_encoding(point)[u(n - config_.volume_ch)];
  });
  std::unordered_map<int, int> rows;
  for (long row = 0; row < p; ++row) rows[in_.selection[u(row)]] = static_cast<int>(row);
  map_.clear();
  for (const int voxel : in_.selection)
    for (long tap = 0; tap < 27; ++tap) {
      const long x = voxel / (r * r) + tap / 9 - 1, y = voxel / r % r + tap / 3 % 3 - 1, z = voxel % r + tap % 3 - 1;
      const bool inside = std::min({x, y, z}) >= 0 && std::max({x, y, z}) < r;
      const auto there = inside ? rows.find(static_cast<int>((x * r + y) * r + z)) : rows.end();
      map_.push_back(there == rows.end() ? -1 : there->second);
    }
  if (ctx_.read<int>(saved.map) != map_) note("neighbours", INFINITY);

  const Layers network = layers_.in("voxel_network");
  const long wide = config_.voxel_ch, seen = projected.empty() ? 0 : c;
  sampled("comp_linear", linear_out, [&](long i) {
    return linear(network, "comp_linear", i % wide, [&](long k) {
      return static_cast<double>(k < seen ? projected[u(i / wide * seen + k)] : beside[u(i / wide * own + k - seen)]);
    });
  });
  ref::Rows plain;
  plain.x0 = linear_out, plain.c0 = wide, plain.rows = p;
  Floats h = saved.blocks.empty() ? read(saved.norm_out.rows.x0) : read(saved.blocks[0].norm1.rows.x0);
  check_sparse(network, "conv_in", plain, h, {});
  for (std::size_t i = 0; i < saved.blocks.size(); ++i) {
    const Layers block = network.in("conv_blocks." + std::to_string(i / 2)).in("res." + std::to_string(i % 2));
    const ref::Rows first = checked_norm(block, "norm1", saved.blocks[i].norm1.rows),
                    second = checked_norm(block, "norm2", saved.blocks[i].norm2.rows);
    const Floats next = read(i + 1 < saved.blocks.size() ? saved.blocks[i + 1].norm1.rows.x0 : saved.norm_out.rows.x0);
    check_sparse(block, "conv1", first, second.x0, {});
    check_sparse(block, "conv2", second, next, h);
    h = next;
  }
  check_sparse(network, "conv_out", checked_norm(network, "norm_out", saved.norm_out.rows), tap("refined"), {});
}

void ModelCheck::check_sparse(const Layers& layers, const std::string& name, const ref::Rows& in, const Floats& out,
                              const Floats& residual) {
  const Floats &w = layers.at(name + ".weight"), &bias = layers.at(name + ".bias");
  const long channels = in.c0 + in.c1, wide = static_cast<long>(bias.size()),
             taps = static_cast<long>(w.size()) / (channels * wide);
  sampled(layers.prefix + name, out, [&](long i) {
    const long row = i / wide, n = i % wide;
    double sum = static_cast<double>(bias[u(n)]) + (residual.empty() ? 0 : static_cast<double>(residual[u(i)]));
    for (long tap = 0; tap < taps; ++tap) {
      const long from = taps == 1 ? row : map_[u(row * 27 + tap)];
      for (long c = 0; c < channels && from >= 0; ++c)
        sum += static_cast<double>(w[u((n * taps + tap) * channels + c)]) * in.at(from, c);
    }
    return sum;
  });
}

void ModelCheck::check_final() {
  const Layers heads = layers_.in("predictor");
  const long p = static_cast<long>(in_.selection.size()), m = config_.fine_count, size = config_.primitive_size(),
             sh = 3L * config_.sh_count();
  const double voxel = 1.0 / config_.volume;
  const Floats& places = layers_.at("div_offset");
  const auto in = [&](long row) {
    return [this, row](long c) -> double { return tap("refined")[u(row * config_.fine_dim + c)]; };
  };
  check_gaussians("final", [&](long k) {
    ref::GaussianLists out;
    const long row = k < m * p ? k / m : k - m * p;
    if (k < m * p) {
      double anchor[3];
      for (long i = 0; i < 3; ++i)
        anchor[i] = coarse("means", row, i, 3) + static_cast<double>(places[u(k % m * 3 + i)]);
      std::vector<double> raw;
      for (long n = 0; n < size; ++n) raw.push_back(mlp3(heads, "fine_predictor", k % m * size + n, in(row)));
      ref::decode(raw.data(), anchor, voxel / 8, voxel, sh, out);
      return out;
    }
    for (long i = 0; i < 3; ++i)
      out.means.push_back(coarse("means", row, i, 3)), out.scales.push_back(coarse("scales", row, i, 3));
    for (long i = 0; i < 4; ++i) out.quats.push_back(coarse("quats", row, i, 4));
    for (long i = 0; i < sh; ++i) out.sh.push_back(mlp3(heads, "update_predictor", i, in(row)));
    out.opacities.push_back(ref::logistic(mlp3(heads, "update_predictor", sh, in(row))) *
                            coarse("opacities", row, 0, 1));
    return out;
  });
}

}  // namespace vsplat::bench
