// What stands around the GEMM of the patch embedding, which is a convolution whose stride is its size p: the GEMM's
// rows before it, the tokens' positions after it. A picture has t x t patches, t = S / p.
#include "common.clh"

// The mean and standard deviation of the pictures that the encoder was trained on (ImageNet), for red, green and blue.
constant float image_mean[3] = {0.485f, 0.456f, 0.406f};
constant float image_deviation[3] = {0.229f, 0.224f, 0.225f};

// ```
// argument    type  shape         what
// images      f32   [V,S,S,3]     pictures, each value in [0, 1]
// rows        f32   [V,1+tt,3pp]  written: (image - mean) / deviation; of a row the channel is slowest, then y, then x,
//                                 as PyTorch stores the weight; the class token's row of each view is zero
// work-items  (y, patch, view): one per line of pixels of a patch; patch 0 is the class token's row
// ```
kernel void patch_embed_rows(global const float* images, global float* rows, int V, int S, int p) {
  const int y = get_global_id(0), patch = get_global_id(1), v = get_global_id(2);
  const int t = S / p;
  if (y >= p || patch > t * t || v >= V) return;
  global float* to = rows + ((size_t)v * (1 + t * t) + patch) * 3 * p * p + (size_t)y * p;
  if (patch == 0) {
    for (int c = 0; c < 3; ++c)
      for (int x = 0; x < p; ++x) to[(size_t)c * p * p + x] = 0.0f;
    return;
  }
  const int py = (patch - 1) / t, px = (patch - 1) % t;
  global const float* from = images + (((size_t)v * S + (size_t)py * p + y) * S + (size_t)px * p) * 3;
  for (int c = 0; c < 3; ++c)
    for (int x = 0; x < p; ++x) to[(size_t)c * p * p + x] = (from[3 * x + c] - image_mean[c]) / image_deviation[c];
}

// ```
// argument    type  shape    what
// position    f32   [T,C]    positions of T = 1 + t t tokens; row 0 holds class token plus position
// tokens      f32   [V,T,C]  the GEMM's result, in place: + position. The class token becomes its row of `position`
// work-items  (4 channels, token, view)
// ```
kernel void patch_embed_forward_tokens(global const float* position, global float* tokens, int V, int T, int C) {
  const int c0 = get_global_id(0) * 4, token = get_global_id(1), v = get_global_id(2);
  if (c0 >= C || token >= T || v >= V) return;
  global const float* from = position + (size_t)token * C + c0;
  global float* to = tokens + ((size_t)v * T + token) * C + c0;
  const int count = min(4, C - c0);
  for (int c = 0; c < count; ++c) to[c] = token == 0 ? from[c] : to[c] + from[c];
}

// Backward of patch_embed_forward_tokens.
// ```
// argument    type  shape    what
// dtokens     f32   [V,T,C]  gradient of the tokens, T = 1 + t t
// dposition   f32   [T,C]    written: the sum over the views
// dpatches    f32   [T-1,C]  written: the same without the class token, whose row the GEMM's result never reached
// work-items  (channel, token)
// ```
kernel void patch_embed_backward_positions(global const float* dtokens, global float* dposition, global float* dpatches,
                                           int V, int T, int C) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token >= T) return;
  float sum = 0.0f;
  for (int v = 0; v < V; ++v) sum += dtokens[((size_t)v * T + token) * C + c];
  dposition[(size_t)token * C + c] = sum;
  if (token > 0) dpatches[(size_t)(token - 1) * C + c] = sum;
}
