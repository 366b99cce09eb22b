// The image encoder: a DINO vision transformer (class token, learned positions resampled to the token grid).
#pragma once
#include <vector>

#include "model/config.h"
#include "model/upload_weights.h"
#include "runtime/gemm.h"

namespace vsplat {

class Vit {
 public:
  // Takes "encoder.model.*". Resamples the positions once, here.
  Vit(Context& ctx, const Config& config, const WeightSource& weights);

  // images [V, S, S, 3] in [0,1] -> tokens [V, 1 + t t, C] after the final norm, the class token first.
  Tensor forward(Context& ctx, const Tensor& images) const;

 private:
  struct Norm {
    Tensor gamma, beta;
  };
  struct Linear {
    PackedMatrix weight;
    Tensor bias;
  };
  struct Layer {
    Norm norm1, norm2;
    Linear qkv, proj, fc1, fc2;
  };
  void layer(Context& ctx, const Layer& layer, const Tensor& x) const;

  Config config_;
  Linear patch_;
  Tensor position_;  // [1 + t t, C], the class token added to its own
  std::vector<Layer> layers_;
  Norm norm_;
};

}  // namespace vsplat
