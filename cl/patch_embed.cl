// What surrounds the patch embedding's GEMM (a convolution whose stride is its size p): its rows, and the tokens'
// positions.
//   images [V, S, S, 3] in [0,1], t = S / p patches along an edge
//   rows   [V (1 + t t), 3 p p]  ((image - mean) / deviation), channel, then y, then x, as PyTorch stores the weight;
//   the class
//                                token's row of each view is zero
//   tokens [V, 1 + t t, C]       the GEMM's result; in place: + position [1 + t t, C]. The class token becomes its own
//   row of
//                                `position`, which holds class token plus position
// Backward, from dtokens [V, 1 + t t, C]:
//   dposition [1 + t t, C]  the sum over the views
//   dpatches  [t t, C]      the same without the class token, whose row the GEMM's result never reached
// patch_embed_rows: one work-item per line of a patch, (y, patch, view). patch_embed_forward_tokens: one per 4 channels, (C / 4 rounded up,
// token, view).
// patch_embed_backward_positions: one per (channel, token).
#include "common.clh"

constant float image_mean[3] = {0.485f, 0.456f, 0.406f};
constant float image_deviation[3] = {0.229f, 0.224f, 0.225f};

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

kernel void patch_embed_forward_tokens(global const float* position, global float* tokens, int V, int T, int C) {
  const int c0 = get_global_id(0) * 4, token = get_global_id(1), v = get_global_id(2);
  if (c0 >= C || token >= T || v >= V) return;
  global const float* from = position + (size_t)token * C + c0;
  global float* to = tokens + ((size_t)v * T + token) * C + c0;
  const int count = min(4, C - c0);
  for (int c = 0; c < count; ++c) to[c] = token == 0 ? from[c] : to[c] + from[c];
}

kernel void patch_embed_backward_positions(global const float* dtokens, global float* dposition, global float* dpatches,
                                           int V, int T, int C) {
  const int c = get_global_id(0), token = get_global_id(1);
  if (c >= C || token >= T) return;
  float sum = 0.0f;
  for (int v = 0; v < V; ++v) sum += dtokens[((size_t)v * T + token) * C + c];
  dposition[(size_t)token * C + c] = sum;
  if (token > 0) dpatches[(size_t)(token - 1) * C + c] = sum;
}
