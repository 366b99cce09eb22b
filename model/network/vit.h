// The image encoder: a DINO vision transformer (class token, learned positions resampled to the token grid).
#pragma once
#include <vector>

#include "model/network/layers.h"
#include "model/params/config.h"

namespace vsplat {

class Vit {
 public:
  // Takes "encoder.model.*". Resamples the positions once, here.
  Vit(Context& ctx, const Config& config, const WeightSource& weights);

  // What the backward wants of a forward; norms and GELU it makes again. 10 values a layer, token and channel.
  struct LayerSaved {
    Tensor x;                     // [V, T, C], the layer's input
    Tensor qkv, attended, stats;  // see model/ops/attention.h
    Tensor middle;                // [V, T, C], between attention and MLP
    Tensor hidden;                // [V T, 4 C], before GELU
  };
  struct Saved {
    Tensor images;
    std::vector<LayerSaved> layers;
    Tensor last;  // [V, T, C], before the final norm
  };

  // images [V, S, S, 3] in [0,1] -> tokens [V, 1 + t t, C] after the final norm, the class token first.
  Tensor forward(Context& ctx, const Tensor& images, Saved* saved = nullptr) const;
  // dtokens [V, 1 + t t, C], by forward's result: adds to the gradients by the weights. Of the images there is none.
  void backward(Context& ctx, const Saved& saved, const Tensor& dtokens) const;

 private:
  struct Layer {
    LayerNorm norm1, norm2;
    Linear qkv, proj, fc1, fc2;
  };
  Tensor forward(Context& ctx, const Layer& layer, const Tensor& x, LayerSaved* saved) const;
  void backward(Context& ctx, const Layer& layer, const LayerSaved& saved, const Tensor& dx) const;

  Config config_;
  Linear patch_;
  Tensor position_;            // [1 + t t, C], the class token added to its own
  Tensor dposition_, dclass_;  // in training, as stored: [1 + g g, C], [C]
  std::vector<Layer> layers_;
  LayerNorm norm_;
};

}  // namespace vsplat
