// The heads: a confidence and a coarse primitive per voxel; M fine primitives and a correction of the coarse one per
// selected voxel.
#pragma once
#include "model/base/gaussians.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class CoarseHeads {
 public:
  // Loads "predictor.act_predictor.*" and "predictor.coarse_predictor.*".
  CoarseHeads(Context& ctx, const Config& config, const WeightSource& weights);

  struct Output {
    Tensor logits;              // [R^3]
    DeviceGaussians gaussians;  // R^3, opacities before refinement by the confidence
  };
  struct Saved {
    Mlp3Saved act_predictor, coarse_predictor;
    Tensor raw;  // [R^3, A]
  };
  // volume [R^3, C~]. `saved`: receives what the backward needs.
  Output forward(Context& ctx, const Tensor& volume, Saved* saved = nullptr) const;
  // Takes the gradients by the outputs; writes the gradient by the volume, or adds it if `add` is set. `dlogits` is
  // empty if nothing depends on the logits: the confidence's weights then get no gradient.
  void backward(Context& ctx, const Saved& saved, const Tensor& dlogits, const GaussianGradients& dgaussians,
                const Tensor& dvolume, bool add) const;

 private:
  Config config_;
  CoarseHeadLayers<WeightLoader> layers_;
};

class FineHeads {
 public:
  // Loads "predictor.fine_predictor.*", "predictor.update_predictor.*" and "div_offset".
  FineHeads(Context& ctx, const Config& config, const WeightSource& weights);

  // refined [P, fine_dim], the skeleton's P Gaussians with refined opacity -> M P fine Gaussians, voxel by voxel, then
  // the P adjusted ones.
  struct Saved {
    Mlp3Saved fine_predictor, update_predictor;
    Tensor raw;        // [P, M A]
    Tensor update;     // [P, 3S + 1]
    Tensor opacities;  // [P]: the skeleton's
  };
  DeviceGaussians forward(Context& ctx, const Tensor& refined, const DeviceGaussians& skeleton,
                          Saved* saved = nullptr) const;
  // dfinal: gradients by the M P + P Gaussians. Overwrites drefined [P, fine_dim]. Adds to dskeleton, except to its SH,
  // on which nothing depends and which may be empty.
  void backward(Context& ctx, const Saved& saved, const GaussianGradients& dfinal, const Tensor& drefined,
                const GaussianGradients& dskeleton) const;

 private:
  Config config_;
  FineHeadLayers<WeightLoader> layers_;
  FinePlaceLayers<WeightLoader> places_;
};

}  // namespace vsplat
