// The heads: per voxel a confidence and a coarse primitive; per selected voxel M fine primitives and a correction of
// the coarse one.
#pragma once
#include "model/config.h"
#include "model/gaussians.h"
#include "model/layers.h"

namespace vsplat {

class CoarseHeads {
 public:
  // Takes "predictor.act_predictor.*" and "predictor.coarse_predictor.*".
  CoarseHeads(Context& ctx, const Config& config, const WeightSource& weights);

  struct Output {
    Tensor logits;              // [R^3]
    DeviceGaussians gaussians;  // R^3, opacities not yet refined by the confidence
  };
  // volume [R^3, C~]
  Output forward(Context& ctx, const Tensor& volume) const;

 private:
  Config config_;
  Mlp3 act_predictor_, coarse_predictor_;
};

class FineHeads {
 public:
  // Takes "predictor.fine_predictor.*", "predictor.update_predictor.*" and "div_offset".
  FineHeads(Context& ctx, const Config& config, const WeightSource& weights);

  // refined [P, fine_dim], the skeleton's P Gaussians with refined opacity -> M P fine ones, voxel by voxel, then the P
  // adjusted ones.
  DeviceGaussians forward(Context& ctx, const Tensor& refined, const DeviceGaussians& skeleton) const;

 private:
  Config config_;
  Mlp3 fine_predictor_, update_predictor_;
  Tensor div_offset_;  // [M, 3]
};

}  // namespace vsplat
