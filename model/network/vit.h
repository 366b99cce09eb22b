// The image encoder: a DINO vision transformer (class token, learned positions resampled to the token grid).
#pragma once
#include <string>
#include <vector>

#include "model/network/upload_weights.h"
#include "model/params/config_fields.h"

namespace vsplat {

class Vit {
 public:
  // Takes "<module>.model.*". Resamples the positions once, here.
  Vit(Context& ctx, const EncoderSizes& sizes, const WeightSource& weights, const std::string& module = "encoder");

  // What the backward wants of a forward; norms and GELU it makes again. 10 values a block, token and channel.
  struct BlockSaved {
    Tensor x;                     // [V, T, C], the block's input
    Tensor qkv, attended, stats;  // see model/ops/attention.h
    Tensor middle;                // [V, T, C], between attention and MLP
    Tensor hidden;                // [V T, 4 C], before GELU
  };
  struct Saved {
    Tensor images;
    std::vector<BlockSaved> blocks;
    Tensor last;  // [V, T, C], before the final norm
  };

  // images [V, S, S, 3] in [0,1] -> tokens [V, 1 + t t, C] after the final norm, the class token first.
  Tensor forward(Context& ctx, const Tensor& images, Saved* saved = nullptr) const;
  // dtokens [V, 1 + t t, C], by forward's result: adds to the gradients by the weights. Of the images there is none.
  void backward(Context& ctx, const Saved& saved, const Tensor& dtokens) const;

 private:
  using Block = EncoderLayers<WeightLoader>::Block;
  Tensor forward(Context& ctx, const Block& block, const Tensor& x, BlockSaved* saved) const;
  void backward(Context& ctx, const Block& block, const BlockSaved& saved, const Tensor& dx) const;

  EncoderSizes config_;
  EncoderLayers<WeightLoader> layers_;
};

}  // namespace vsplat
