// The confidence that a point is worth refining: a sigmoid of its logit, or a softmax over all points; and the gradient
// of feature x confidence, which replaces that of the choice (straight through).
// ```
// argument    type  shape  what
// logits      f32   [P]
// confidence  f32   [P]    written
// work-items  sigmoid: one per point; softmax: one group of GROUP
// ```
#include "common.clh"

#ifndef GROUP
#define GROUP 64
#endif

kernel void confidence_forward(global const float* restrict logits, global float* restrict confidence, int P) {
  const int p = get_global_id(0);
  if (p < P) confidence[p] = sigmoid(logits[p]);
}

// The largest or the sum over the group, in a fixed order. It holds barriers, so every work-item must call it.
static float group_fold(float mine, int sum, local float* part) {
  const int item = get_local_id(0);
  part[item] = mine;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int half_ = GROUP / 2; half_ > 0; half_ /= 2) {
    if (item < half_) part[item] = sum ? part[item] + part[item + half_] : fmax(part[item], part[item + half_]);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const float all = part[0];
  barrier(CLK_LOCAL_MEM_FENCE);
  return all;
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void confidence_forward_softmax(
    global const float* restrict logits, global float* restrict confidence, int P) {
  local float part[GROUP];
  const int item = get_local_id(0);
  float largest = -INFINITY, total = 0.0f;
  for (int p = item; p < P; p += GROUP) largest = fmax(largest, logits[p]);
  largest = group_fold(largest, 0, part);
  for (int p = item; p < P; p += GROUP) total += exp(logits[p] - largest);
  total = group_fold(total, 1, part);
  for (int p = item; p < P; p += GROUP) confidence[p] = exp(logits[p] - largest) / total;
}

// Backward of y = x confidence.
// ```
// argument     type  shape  what
// x            f32   [P,C]  the features
// dy           f32   [P,C]  gradient of y
// dx           f32   [P,C]  written: dy confidence; may be dy
// dconfidence  f32   [P]    written: dy . x
// work-items   one per point
// ```
kernel void confidence_backward(global const float* restrict x, global const float* restrict confidence,
                                global const float* dy, global float* dx, global float* restrict dconfidence, int P,
                                int C) {
  const int p = get_global_id(0);
  if (p >= P) return;
  float sum = 0.0f;
  for (size_t i = (size_t)p * C; i < (size_t)(p + 1) * C; ++i) {
    sum += dy[i] * x[i];
    dx[i] = dy[i] * confidence[p];
  }
  dconfidence[p] = sum;
}

// ```
// dlogits      f32   [P]    written
// softmax      int          0: of a sigmoid
// work-items   one group of GROUP
// ```
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void confidence_backward_logits(
    global const float* restrict confidence, global const float* restrict dconfidence, global float* restrict dlogits,
    int P, int softmax) {
  local float part[GROUP];
  const int item = get_local_id(0);
  float mean = 0.0f;
  if (softmax) {
    for (int p = item; p < P; p += GROUP) mean += confidence[p] * dconfidence[p];
    mean = group_fold(mean, 1, part);
  }
  for (int p = item; p < P; p += GROUP) {
    const float c = confidence[p];
    dlogits[p] = softmax ? c * (dconfidence[p] - mean) : c * (1.0f - c) * dconfidence[p];
  }
}
