// The heads in double: three linear layers with SiLU between them, then the decoding of their outputs.
#pragma once
#include <string>
#include <vector>

#include "model/diagnose/selftest/reference/decode.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/networks/params/config.h"
#include "model/networks/params/weights.h"

namespace vsplat::ref {

// x [rows, in] -> [rows, out], with the weights "predictor.<name>.0", ".2" and ".4".
inline std::vector<double> mlp3(const Weights& weights, const std::string& name, std::vector<double> x,
                                std::size_t rows) {
  for (const char* layer : {".0", ".2", ".4"}) {
    const std::vector<float>& w = weights.at("predictor." + name + layer + ".weight").data;
    const std::vector<float>& b = weights.at("predictor." + name + layer + ".bias").data;
    const std::size_t out = b.size(), in = w.size() / out;
    std::vector<double> y;
    for (std::size_t r = 0; r < rows; ++r)
      for (std::size_t j = 0; j < out; ++j) {
        double sum = b[j];
        for (std::size_t i = 0; i < in; ++i) sum += w[j * in + i] * x[r * in + i];
        y.push_back(std::string(layer) == ".4" ? sum : silu(sum));
      }
    x = std::move(y);
  }
  return x;
}

struct CoarseHeads {
  std::vector<double> logits;
  GaussianLists gaussians;
};

inline CoarseHeads coarse_heads(const Config& config, const Weights& weights, const std::vector<double>& volume) {
  const long r = config.volume;
  const auto voxels = static_cast<std::size_t>(config.voxels());
  const double voxel = 1.0 / static_cast<double>(r);
  CoarseHeads out;
  out.logits = mlp3(weights, "act_predictor", volume, voxels);
  const std::vector<double> raw = mlp3(weights, "coarse_predictor", volume, voxels);
  for (long v = 0; v < config.voxels(); ++v) {
    const long at[3] = {v / (r * r), v / r % r, v % r};
    double anchor[3];
    for (int i = 0; i < 3; ++i) anchor[i] = (static_cast<double>(at[i]) + 0.5) * voxel - 0.5;
    decode(&raw[static_cast<std::size_t>(v * config.primitive_size())], anchor, voxel / 4, voxel, 3 * config.sh_count(),
           out.gaussians);
  }
  return out;
}

// refined [P, fine_dim] and the skeleton's P Gaussians -> M P, then P.
inline GaussianLists fine_heads(const Config& config, const Weights& weights, const std::vector<double>& refined,
                                const GaussianLists& skeleton) {
  const std::size_t p = skeleton.opacities.size(), sh = 3 * static_cast<std::size_t>(config.sh_count());
  const double voxel = 1.0 / static_cast<double>(config.volume);
  const std::vector<float>& offsets = weights.at("div_offset").data;
  GaussianLists out;
  const std::vector<double> raw = mlp3(weights, "fine_predictor", refined, p);
  const std::vector<double> update = mlp3(weights, "update_predictor", refined, p);
  const auto m = static_cast<std::size_t>(config.fine_count), size = sh + 11;
  for (std::size_t k = 0; k < p * m; ++k) {
    double anchor[3];
    for (std::size_t i = 0; i < 3; ++i) anchor[i] = skeleton.means[k / m * 3 + i] + offsets[k % m * 3 + i];
    decode(&raw[k * size], anchor, voxel / 8, voxel, static_cast<long>(sh), out);
  }
  for (std::size_t i = 0; i < p; ++i) {
    const double* row = &update[i * (sh + 1)];
    out.sh.insert(out.sh.end(), row, row + sh);
    out.opacities.push_back(logistic(row[sh]) * skeleton.opacities[i]);
  }
  out.means.insert(out.means.end(), skeleton.means.begin(), skeleton.means.end());
  out.scales.insert(out.scales.end(), skeleton.scales.begin(), skeleton.scales.end());
  out.quats.insert(out.quats.end(), skeleton.quats.begin(), skeleton.quats.end());
  return out;
}

}  // namespace vsplat::ref
