// The fine stage's features in double, from the definition.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/diagnose/selftest/reference/gemm.h"
#include "model/diagnose/selftest/reference/groupnorm.h"
#include "model/diagnose/selftest/reference/position_encoding.h"
#include "model/diagnose/selftest/reference/project_features.h"
#include "model/diagnose/selftest/reference/sparse_map.h"
#include "model/networks/params/config.h"

namespace vsplat::ref {

struct RefineCase {
  Config config;
  std::vector<Camera> cameras;
  std::vector<int> index;                              // [P]
  std::vector<double> volume, features, means;         // [R^3, C~], [V, t, t, C], [P, 3]
  std::map<std::string, std::vector<double>> weights;  // without "voxel_network."

  std::size_t rows() const { return index.size(); }

  // Concatenates [P, Ca] and [P, Cb].
  std::vector<double> concat(const std::vector<double>& a, const std::vector<double>& b) const {
    const std::size_t ca = a.size() / rows(), cb = b.size() / rows();
    std::vector<double> out;
    for (std::size_t p = 0; p < rows(); ++p) {
      for (std::size_t c = 0; c < ca; ++c) out.push_back(a[p * ca + c]);
      for (std::size_t c = 0; c < cb; ++c) out.push_back(b[p * cb + c]);
    }
    return out;
  }

  // Row p is the sum over taps of the weights [N, taps, C] applied to row map[p, tap], plus the bias.
  std::vector<double> product(const std::string& name, const std::vector<double>& x,
                              const std::vector<int>& map) const {
    const std::vector<double>&w = weights.at(name + ".weight"), &bias = weights.at(name + ".bias");
    const std::size_t c = x.size() / rows(), taps = map.size() / rows();
    std::vector<double> out;
    for (std::size_t p = 0; p < rows(); ++p)
      for (std::size_t n = 0; n < bias.size(); ++n) {
        double sum = bias[n];
        for (std::size_t tap = 0; tap < taps; ++tap) {
          const int row = map[p * taps + tap];
          for (std::size_t i = 0; i < c && row >= 0; ++i)
            sum += w[(n * taps + tap) * c + i] * x[static_cast<std::size_t>(row) * c + i];
        }
        out.push_back(sum);
      }
    return out;
  }

  std::vector<double> norm_silu(const std::string& name, const std::vector<double>& x) const {
    std::vector<double> out =
        groupnorm(x, rows(), x.size() / rows(), static_cast<std::size_t>(config.groups),
                  weights.at(name + ".group_norm.weight"), weights.at(name + ".group_norm.bias"), 1e-6);
    for (double& v : out) v = silu(v);
    return out;
  }
};

// [P, fine_dim], for P > 0.
inline std::vector<double> refine(const RefineCase& in) {
  std::vector<int> same;
  for (std::size_t p = 0; p < in.rows(); ++p) same.push_back(static_cast<int>(p));
  const std::vector<int> near = sparse_map(in.index, in.config.volume);
  std::vector<double> projected, own;
  if (in.config.use_projected) {
    projected =
        project_features({in.config.tokens(), in.config.vit_dim, in.cameras, in.config.image,
                          in.config.sample_half_pixel, in.config.view_weight == "distance", in.features, in.means});
  }
  const auto channels = static_cast<std::size_t>(in.config.volume_ch);
  for (const int voxel : in.index)
    for (std::size_t c = 0; c < channels; ++c) own.push_back(in.volume[static_cast<std::size_t>(voxel) * channels + c]);
  own = in.concat(own, position_encoding(in.means));

  std::vector<double> h = in.product("comp_linear", in.concat(projected, own), same);
  h = in.product("conv_in", h, near);
  for (int i = 0; i < 2 * in.config.voxel_levels; ++i) {
    const std::string name = "conv_blocks." + std::to_string(i / 2) + ".res." + std::to_string(i % 2);
    std::vector<double> inner = in.product(name + ".conv1", in.norm_silu(name + ".norm1", h), near);
    inner = in.product(name + ".conv2", in.norm_silu(name + ".norm2", inner), near);
    for (std::size_t at = 0; at < h.size(); ++at) h[at] += inner[at];
  }
  h = in.norm_silu("norm_out", in.concat(h, projected));
  return in.product("conv_out", h, in.config.refine_out_kernel == 3 ? near : same);
}

}  // namespace vsplat::ref
