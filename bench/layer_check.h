// How forward_check.cpp looks at a forward: the layers' weights by name, single results in double, and the worst error.
#pragma once
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "bench/case_data.h"
#include "bench/forward_check.h"
#include "model/diagnose/selftest/reference/decode.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/networks/layers/transformer.h"
#include "model/networks/vsplat/unet3d.h"

namespace vsplat::bench {

using Floats = std::vector<float>;

inline constexpr int kLayerSamples = 24;
inline constexpr double kNormEps = 1e-6;

inline std::size_t u(long v) { return static_cast<std::size_t>(v); }

// The state dict's tensors below a name.
struct Layers {
  const Weights& all;
  std::string prefix;

  Layers in(const std::string& name) const { return {all, prefix + name + "."}; }
  const Floats& at(const std::string& name) const { return all.at(prefix + name).data; }
  bool has(const std::string& name) const { return all.has(prefix + name); }
};

// Element n of a Linear of in(0), in(1), ...
template <class In>
double linear(const Layers& layers, const std::string& name, long n, const In& in) {
  const Floats &w = layers.at(name + ".weight"), &bias = layers.at(name + ".bias");
  const long width = static_cast<long>(w.size() / bias.size());
  double sum = static_cast<double>(bias[u(n)]);
  for (long c = 0; c < width; ++c) sum += static_cast<double>(w[u(n * width + c)]) * in(c);
  return sum;
}

// Three with SiLU between them.
template <class In>
double mlp3(const Layers& layers, const std::string& name, long n, const In& in) {
  std::vector<double> x, y;
  for (const char* layer : {".0", ".2"}) {
    y.clear();
    const auto width = static_cast<long>(layers.at(name + layer + ".bias").size());
    for (long i = 0; i < width; ++i)
      y.push_back(ref::silu(linear(layers, name + layer, i, [&](long c) { return x.empty() ? in(c) : x[u(c)]; })));
    x = y;
  }
  return linear(layers, name + ".4", n, [&](long c) { return x[u(c)]; });
}

// LayerNorm of one row of x [.., c].
class NormedRow {
 public:
  NormedRow(const Layers& layers, const std::string& name, const Floats& x, long row)
      : gamma_(layers.at(name + ".weight")), beta_(layers.at(name + ".bias")), x_(&x[u(row) * gamma_.size()]) {
    const auto count = static_cast<double>(gamma_.size());
    for (std::size_t i = 0; i < gamma_.size(); ++i) mean_ += static_cast<double>(x_[i]) / count;
    for (std::size_t i = 0; i < gamma_.size(); ++i)
      variance_ += std::pow(static_cast<double>(x_[i]) - mean_, 2) / count;
  }
  double operator()(long c) const {
    return (static_cast<double>(x_[c]) - mean_) / std::sqrt(variance_ + kNormEps) * static_cast<double>(gamma_[u(c)]) +
           static_cast<double>(beta_[u(c)]);
  }

 private:
  const Floats &gamma_, &beta_;
  const float* x_;
  double mean_ = 0, variance_ = 0;
};

class ModelCheck {
 public:
  ModelCheck(Context& ctx, const ModelInput& in) : ctx_(ctx), in_(in), config_(in.config), layers_{in.weights, ""} {}
  double run(const VsplatModel& model, std::string* worst);

 private:
  Floats read(const Tensor& t) const;
  const Floats& tap(const std::string& name) const { return taps_.at(name); }
  Tensor upload(const std::string& name, const Shape& shape) const;
  void note(const std::string& what, double error);
  template <class Want>
  void sampled(const std::string& what, const Floats& got, const Want& want) {
    note(what, worst_error(
                   static_cast<long>(got.size()), kLayerSamples,
                   [&](long i) { return got[static_cast<std::size_t>(i)]; }, want));
  }
  // All of them.
  void same(const std::string& what, const Floats& got, const Floats& want);
  // Encoder and modulation.
  void check_features();
  void check_patches(const Floats& got, long tokens, long c);
  void check_block(const std::string& name, const BlockSaved& saved, const Floats& out, long tokens, long c);
  double ray(long row, long value) const;
  // Lifting and the dense network.
  void check_volume();
  Eigen::Vector3d centre_of(long voxel) const;
  ref::Rows rows_of_source(const RowSource& source) const;
  // The rows with the affine that stands for a GroupNorm, which is held to the statistics of all of them.
  ref::Rows checked_norm(const Layers& layers, const std::string& name, const RowSource& source);
  // 3x3x3 at one voxel.
  double convolved(const Layers& layers, const std::string& name, const ref::Rows& in, long edge, long voxel,
                   long n) const;
  void check_conv(const Layers& layers, const std::string& name, const ref::Rows& in, long edge, const Floats& out);
  // `doubled`: `out` is that of the upsampling which follows.
  void check_res(const Layers& block, const VolumeNetwork::ResSaved& saved, long edge, const Floats& out,
                 bool doubled = false);
  // 2x2x2 with a stride of 2.
  void check_downsampling(const Layers& level, const Floats& in, long edge, const Floats& out);
  double volume_at(long voxel, long c) const;
  // One of the five tensors of a level's Gaussians, against the lists of Gaussian `k`.
  template <class Want>
  void check_gaussians(const std::string& level, const Want& want) {
    using List = std::vector<double> ref::GaussianLists::*;
    const std::pair<const char*, List> parts[] = {{"means", &ref::GaussianLists::means},
                                                  {"scales", &ref::GaussianLists::scales},
                                                  {"quats", &ref::GaussianLists::quats},
                                                  {"opacities", &ref::GaussianLists::opacities},
                                                  {"sh", &ref::GaussianLists::sh}};
    const auto count = static_cast<long>(tap(level + ".opacities").size());
    for (const auto& [name, part] : parts) {
      const Floats& got = tap(level + "." + name);
      const long each = static_cast<long>(got.size()) / count;
      sampled(level + "." + name, got, [&, part = part](long i) { return (want(i / each).*part)[u(i % each)]; });
    }
  }
  void check_coarse();
  // The coarse Gaussian of selected voxel `p`.
  double coarse(const char* part, long p, long i, long each) const;
  void check_refined();
  // Among the selected voxels alone; 1x1x1 if the weights are.
  void check_sparse(const Layers& layers, const std::string& name, const ref::Rows& in, const Floats& out,
                    const Floats& residual);
  // Fine Gaussians, voxel by voxel, then the corrected coarse ones.
  void check_final();
  Context& ctx_;
  const ModelInput& in_;
  const Config& config_;
  Layers layers_;
  std::map<std::string, Floats> taps_;
  std::vector<int> map_;
  double worst_ = 0;
  std::string where_;
};

}  // namespace vsplat::bench
