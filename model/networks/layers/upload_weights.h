// Makes the layers declared in model/networks/params/network_layers.h on the device. Checks each weight against the
// shape that the configuration requires.
#pragma once
#include "model/networks/layers/layers.h"
#include "model/networks/layers/learnt_weights.h"
#include "model/networks/params/network_layers.h"
#include "model/networks/params/weights.h"

namespace vsplat {

// Source of a stage's weights: host memory, from which they are uploaded for inference, or the device, where training
// updates them and needs gradients. Holds a reference to what it was made from.
class WeightSource {
 public:
  WeightSource(const Weights& host) : host_(&host) {}              // NOLINT(google-explicit-constructor)
  WeightSource(const LearntWeights& learnt) : learnt_(&learnt) {}  // NOLINT(google-explicit-constructor)

 private:
  friend class WeightLoader;
  const Weights* host_ = nullptr;
  const LearntWeights* learnt_ = nullptr;
};

// The `Make` of LayerBuilder.
class WeightLoader {
 public:
  using Fixed = Tensor;
  using Learnt = vsplat::Learnt;
  using Positions = vsplat::Positions;
  using Linear = vsplat::Linear;
  using ScaledLinear = vsplat::ScaledLinear;
  using SplitLinear = vsplat::SplitLinear;
  using Conv = vsplat::Conv;
  using ConvUp = vsplat::ConvUp;
  using LayerNorm = vsplat::LayerNorm;
  using GroupNorm = vsplat::GroupNorm;
  using Mlp3 = vsplat::Mlp3;

  WeightLoader(Context& ctx, const WeightSource& weights) : ctx_(&ctx), weights_(weights) {}

  Tensor fixed(const Parameter& p) const { return value(p); }
  Learnt learnt(const Parameter& p) const { return {value(p), gradient(p)}; }
  Positions positions(const Parameter& class_token, const Parameter& stored, int from, int to) const;
  Linear linear(const LayerParameters& p) const;
  ScaledLinear scaled_linear(const LayerParameters& p, const Learnt* scale) const;
  SplitLinear split_linear(const LayerParameters& p, long first) const;
  Conv conv3d(const LayerParameters& p) const;
  Conv conv3d_down(const LayerParameters& p) const;
  ConvUp conv3d_up(const LayerParameters& p) const;
  Conv submanifold(const LayerParameters& p) const;
  LayerNorm layer_norm(const LayerParameters& p) const;
  GroupNorm group_norm(const LayerParameters& p, int groups) const;

 private:
  const std::vector<float>& host(const Parameter& p) const;
  const LearntTensor& on_device(const Parameter& p) const;
  // The weight as stored; empty for a weight without a name, which the layer does not have.
  Tensor value(const Parameter& p) const;
  // In training the tensor itself, which only the backward needs, and its gradient, which is added to; otherwise empty.
  Tensor plain(const Parameter& p) const;
  Tensor gradient(const Parameter& p) const;
  // Columns [k0, k0 + k) of a weight [N, ...], as the k x N matrix of a GEMM.
  PackedMatrix columns(const Parameter& p, long k0, long k) const;
  Conv conv(const LayerParameters& p, ConvWeights weights) const;

  Context* ctx_;
  WeightSource weights_;
};

// For the stages' constructors: `EncoderLayers<WeightLoader>(layers_of(ctx, weights), config)`.
inline LayerBuilder<WeightLoader> layers_of(Context& ctx, const WeightSource& weights) {
  return LayerBuilder<WeightLoader>(WeightLoader(ctx, weights));
}

}  // namespace vsplat
