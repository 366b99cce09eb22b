// Converts pictures to tokens: a convolution with a stride of its size, as one GEMM, then class token and positions.
#pragma once
#include "runtime/gemm.h"

namespace vsplat {

struct PatchEmbedForward {
  Tensor images;                         // [V, H, W, 3] in [0,1]; normalised here by ImageNet's mean and deviation
  int patch = 0;                         // p, pixels; divides H and W
  const PackedMatrix* weight = nullptr;  // [3 p p, C]: channel, then y, then x, as PyTorch stores the convolution
  Tensor bias;                           // [C]
  // [P + h w, C], h = H / p, w = W / p: the tokens before the patches (the class token plus its position), then the
  // patches' positions; or [P, C] if patches have no positions.
  Tensor position;
  Tensor out;  // [V, P + h w, C]
};

void patch_embed_forward(Context& ctx, const PatchEmbedForward& a);

struct PatchEmbedBackward {
  Tensor images;     // [V, H, W, 3], as in the forward
  int patch = 0;     // p
  Tensor dtokens;    // [V, P + h w, C]: gradient by the forward's out
  Tensor dweight;    // [C, 3, p, p], added to
  Tensor dbias;      // [C], added to
  Tensor dposition;  // as forward's position; written
};

// There is no gradient by the pictures.
void patch_embed_backward(Context& ctx, const PatchEmbedBackward& a);

}  // namespace vsplat
