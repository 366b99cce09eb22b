// From pictures to tokens: a convolution whose stride is its size, as one GEMM, then class token and positions.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

struct PatchEmbedForward {
  Tensor images;                         // [V, S, S, 3] in [0,1]; normalised here by ImageNet's mean and deviation
  int patch = 0;                         // p, pixels; divides S
  const PackedMatrix* weight = nullptr;  // [3 p p, C]: channel, then y, then x, as PyTorch stores the convolution
  Tensor bias;                           // [C]
  Tensor position;                       // [1 + t t, C], t = S / p: class token plus its position, then the positions
  Tensor out;                            // [V, 1 + t t, C]
};

void patch_embed_forward(Context& ctx, const PatchEmbedForward& a);

struct PatchEmbedBackward {
  Tensor images;     // [V, S, S, 3], as forward had them
  int patch = 0;     // p
  Tensor dtokens;    // [V, 1 + t t, C]: the loss by forward's out
  Tensor dweight;    // [C, 3, p, p], added to
  Tensor dbias;      // [C], added to
  Tensor dposition;  // [1 + t t, C]; written
};

// Of the pictures there is no gradient.
void patch_embed_backward(Context& ctx, const PatchEmbedBackward& a);

}  // namespace vsplat
