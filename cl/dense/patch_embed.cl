// The steps around the GEMM of the patch embedding, which is a convolution with a stride of its size p: the GEMM's rows
// before it, the tokens' positions after it. A picture has h x w patches, h = H / p, w = W / p. P tokens that are no
// patches come before them: a class token, registers. T = P + h w.
#include "common.clh"

// The mean and standard deviation of the pictures that the encoder was trained on (ImageNet), for red, green and blue.
constant float image_mean[3] = {0.485f, 0.456f, 0.406f};
constant float image_deviation[3] = {0.229f, 0.224f, 0.225f};

// ```
// argument    type  shape         what
// images      f32   [V,H,W,3]     pictures, each value in [0, 1]
// rows        f32   [V,T,3pp]     written: (image - mean) / deviation; in a row the channel is slowest, then y, then x,
//                                 as PyTorch stores the weight; the first P rows of each view are zero
// work-items  (y, token, view): one per line of pixels of a patch
// ```
kernel void patch_embed_rows(global const float* images, global float* rows, int V, int H, int W, int p, int P) {
  const int y = get_global_id(0), token = get_global_id(1), v = get_global_id(2);
  const int w = W / p, T = P + H / p * w;
  if (y >= p || token >= T || v >= V) return;
  global float* to = rows + ((size_t)v * T + token) * 3 * p * p + (size_t)y * p;
  if (token < P) {
    for (int c = 0; c < 3; ++c)
      for (int x = 0; x < p; ++x) to[(size_t)c * p * p + x] = 0.0f;
    return;
  }
  const int py = (token - P) / w, px = (token - P) % w;
  global const float* from = images + (((size_t)v * H + (size_t)py * p + y) * W + (size_t)px * p) * 3;
  for (int c = 0; c < 3; ++c)
    for (int x = 0; x < p; ++x) to[(size_t)c * p * p + x] = (from[3 * x + c] - image_mean[c]) / image_deviation[c];
}

// ```
// argument    type  shape    what
// position    f32   [N,C]    added to a patch's token; the value of a token before the patches. For the first
//                            N tokens: N is T, or P if patches have no positions
// tokens      f32   [V,T,C]  the GEMM's result, in place: + position. The first P become their rows of `position`
// work-items  (4 channels, token below N, view)
// ```
kernel void patch_embed_forward_tokens(global const float* position, global float* tokens, int V, int T, int C, int P,
                                       int N) {
  const int c0 = get_global_id(0) * 4, token = get_global_id(1), v = get_global_id(2);
  if (c0 >= C || token >= N || v >= V) return;
  global const float* from = position + (size_t)token * C + c0;
  global float* to = tokens + ((size_t)v * T + token) * C + c0;
  const int count = min(4, C - c0);
  for (int c = 0; c < count; ++c) to[c] = token < P ? from[c] : to[c] + from[c];
}

// Backward of patch_embed_forward_tokens.
// ```
// argument    type  shape    what
// dtokens     f32   [V,T,C]  gradient of the tokens
// dposition   f32   [N,C]    written: the sum over the views
// dpatches    f32   [T-P,C]  written: the patches' rows of that sum, for the GEMM's gradient
// work-items  (channel, token)
// ```
kernel void patch_embed_backward_positions(global const float* dtokens, global float* dposition, global float* dpatches,
                                           int V, int T, int C, int P, int N) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token >= T) return;
  float sum = 0.0f;
  for (int v = 0; v < V; ++v) sum += dtokens[((size_t)v * T + token) * C + c];
  if (token < N) dposition[(size_t)token * C + c] = sum;
  if (token >= P) dpatches[(size_t)(token - P) * C + c] = sum;
}
