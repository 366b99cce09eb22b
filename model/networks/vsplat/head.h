// The heads: per voxel a confidence and a coarse primitive; per selected voxel M fine primitives and a correction of
// the coarse one.
#pragma once
#include "model/base/gaussians.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/config.h"

namespace vsplat {

class CoarseHeads {
 public:
  // Takes "predictor.act_predictor.*" and "predictor.coarse_predictor.*".
  CoarseHeads(Context& ctx, const Config& config, const WeightSource& weights);

  struct Output {
    Tensor logits;              // [R^3]
    DeviceGaussians gaussians;  // R^3, opacities not yet refined by the confidence
  };
  struct Saved {
    Mlp3Saved act_predictor, coarse_predictor;
    Tensor raw;  // [R^3, A]
  };
  // volume [R^3, C~]. What `saved` holds is for the backward.
  Output forward(Context& ctx, const Tensor& volume, Saved* saved = nullptr) const;
  // From the loss by the outputs to that by the volume, which is written, or with `add` added to. `dlogits` is none
  // where nothing depends on them: the confidence's weights then get no gradient.
  void backward(Context& ctx, const Saved& saved, const Tensor& dlogits, const GaussianGradients& dgaussians,
                const Tensor& dvolume, bool add) const;

 private:
  Config config_;
  CoarseHeadLayers<WeightLoader> layers_;
};

class FineHeads {
 public:
  // Takes "predictor.fine_predictor.*", "predictor.update_predictor.*" and "div_offset".
  FineHeads(Context& ctx, const Config& config, const WeightSource& weights);

  // refined [P, fine_dim], the skeleton's P Gaussians with refined opacity -> M P fine ones, voxel by voxel, then the P
  // adjusted ones.
  struct Saved {
    Mlp3Saved fine_predictor, update_predictor;
    Tensor raw;        // [P, M A]
    Tensor update;     // [P, 3S + 1]
    Tensor opacities;  // [P]: the skeleton's
  };
  DeviceGaussians forward(Context& ctx, const Tensor& refined, const DeviceGaussians& skeleton,
                          Saved* saved = nullptr) const;
  // dfinal: by the M P + P. drefined [P, fine_dim] is written; dskeleton is added to, except for its SH, on which
  // nothing depends and which may be none.
  void backward(Context& ctx, const Saved& saved, const GaussianGradients& dfinal, const Tensor& drefined,
                const GaussianGradients& dskeleton) const;

 private:
  Config config_;
  FineHeadLayers<WeightLoader> layers_;
  FinePlaceLayers<WeightLoader> places_;
};

}  // namespace vsplat
