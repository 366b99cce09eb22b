// The image encoder, a vision transformer: DINO's (a class token, learned positions resampled to the token grid) or
// DINOv3's (registers beside the class token, rotary position embedding, scaled branches).
#pragma once
#include <string>
#include <vector>

#include "model/networks/layers/transformer.h"
#include "model/networks/params/config_fields.h"

namespace vsplat {

class Vit {
 public:
  // Loads "<module>.model.*". Computes positions, or rotations, for the configuration's grid once.
  Vit(Context& ctx, const EncoderSizes& sizes, const WeightSource& weights, const std::string& module = "encoder");

  // What backward needs from a forward.
  struct Saved {
    Tensor images;
    std::vector<BlockSaved> blocks;
    Tensor last;  // [V, T, C], before the final norm
  };

  // images [V, S, S, 3] in [0,1] -> tokens [V, P + t t, C] after the final norm; the first P = sizes.prefix() are not
  // patches. DINOv3 accepts any [V, H, W, 3] of whole patches.
  Tensor forward(Context& ctx, const Tensor& images, Saved* saved = nullptr) const;
  // dtokens [V, P + t t, C], by forward's result. Adds to the gradients of the weights. There is no gradient by the
  // images.
  void backward(Context& ctx, const Saved& saved, const Tensor& dtokens) const;

 private:
  // Rotations for the patches of these pictures.
  BlockOptions options_for(Context& ctx, const Tensor& images) const;
  Tensor make_turns(Context& ctx, long h, long w) const;
  // Adds to the gradients of the prefix tokens and of the positions.
  void backward_positions(Context& ctx, const Tensor& dposition) const;
  float eps() const { return static_cast<float>(config_.norm_eps); }

  EncoderSizes config_;
  EncoderLayers<WeightLoader> layers_;
  Tensor position_;  // see model/ops/dense/patch_embed.h
  Tensor turns_;     // see model/ops/dense/rope.h
};

}  // namespace vsplat
