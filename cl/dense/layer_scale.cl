// Folds a scale for each output of a Linear into its weights: s (W x + b) = (s W) x + s b. So scaling needs no separate
// pass over the tokens, forward or backward.
// ```
// argument    type  shape  what
// w           f32   [N,K]  weight
// b           f32   [N]    bias
// s           f32   [N]    scales
// w_out       f32   [N,K]  written: s W
// b_out       f32   [N]    written: s b
// work-items  (input of a row: K, row: N)
// ```
#include "common.clh"

kernel void layer_scale_forward(global const float* w, global const float* b, global const float* s,
                                global float* w_out, global float* b_out, int N, int K) {
  const int k = get_global_id(0), n = get_global_id(1);
  if (k >= K || n >= N) return;
  const size_t at = (size_t)n * K + k;
  w_out[at] = s[n] * w[at];
  if (k == 0) b_out[n] = s[n] * b[n];
}

#define GROUP 64

// Backward. With G and g the gradients by s W and s b:
//   dW += s G,  db += s g,  ds += sum_k G W + g b.
// ```
// argument    type  shape  what
// g_w         f32   [N,K]  gradient by s W
// g_b         f32   [N]    gradient by s b
// dw          f32   [N,K]  added to
// db, ds      f32   [N]    added to
// work-items  a group of GROUP a row
// ```
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void layer_scale_backward(
    global const float* w, global const float* b, global const float* s, global const float* g_w,
    global const float* g_b, global float* dw, global float* db, global float* ds, int N, int K) {
  local float part[GROUP];
  const int item = get_local_id(0), n = GROUP_ID(0);
  const float scale = s[n];
  float sum = 0.0f;
  for (int k = item; k < K; k += GROUP) {
    const size_t at = (size_t)n * K + k;
    sum += g_w[at] * w[at];
    dw[at] += scale * g_w[at];
  }
  part[item] = sum;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int half_ = GROUP / 2; half_ > 0; half_ /= 2) {
    if (item < half_) part[item] += part[item + half_];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (item > 0) return;
  ds[n] += part[0] + g_b[n] * b[n];
  db[n] += scale * g_b[n];
}
