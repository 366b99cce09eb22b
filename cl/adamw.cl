// The optimiser: AdamW, the norm of all gradients together with the factor that clips it, and a moving average of weights.   (f32)
#include "common.clh"
#include "vector16.clh"

#ifndef GROUP
#define GROUP 64  // work-items of a group, a power of two
#endif
#ifndef EACH
#define EACH 32  // elements of a work-item in adamw_squares
#endif

// Sum over the group in a fixed order; every item must come here.
static float group_sum(float mine, local float* part) {
  const int item = get_local_id(0);
  part[item] = mine;
  for (int step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step) part[item] += part[item + step];
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  return part[0];
}

// Sums of squares of grad [n] in blocks of GROUP * EACH: those go to sums[first ...]. gpu flavour: a work-group per block.
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void adamw_squares(global const float* restrict grad,
                                                                             global float* restrict sums, int n,
                                                                             int first) {
  local float part[GROUP];
  const int block = get_group_id(0);
  global const float* from = grad + (size_t)block * GROUP * EACH;
  const int left = min(n - block * (GROUP * EACH), GROUP * EACH);
  float sum = 0.0f;
  for (int i = get_local_id(0); i < left; i += GROUP) sum = FMA(from[i], from[i], sum);
  sum = group_sum(sum, part);
  if (get_local_id(0) == 0) sums[first + block] = sum;
}

// cpu flavour: work-groups of one work-item, per block.
kernel void adamw_squares_cpu(global const float* restrict grad, global float* restrict sums, int n, int first) {
  const int block = get_group_id(0), from = block * (GROUP * EACH), left = min(n - from, GROUP * EACH);
  float16 a = 0.0f, b = 0.0f;
  for (int i = 0; i < left; i += 32) {
    const float16 x = load_part(grad + from + i, left - i), y = load_part(grad + from + i + 16, left - i - 16);
    a = FMA(x, x, a);
    b = FMA(y, y, b);
  }
  sums[first + block] = sum_of(a + b);
}

// sums [count] of all tensors -> out [2]: norm = scale * sqrt(total), and the factor for the gradients as they are stored,
// scale * min(1, max_norm / (norm + 1e-6)). One work-group; Kahan's summation, so that the error does not grow with count.
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void adamw_clip(global const float* restrict sums,
                                                                          global float* restrict out, int count,
                                                                          float scale, float max_norm) {
  local float part[GROUP];
  float sum = 0.0f, lost = 0.0f;
  for (int i = get_local_id(0); i < count; i += GROUP) {
    const float add = sums[i] - lost;
    const float next = sum + add;
    lost = (next - sum) - add;
    sum = next;
  }
  sum = group_sum(sum, part);
  if (get_local_id(0) == 0) {
    const float norm = scale * sqrt(sum);
    const float clip = max_norm / (norm + 1e-6f);
    out[0] = norm;
    out[1] = scale * (clip > 1.0f ? 1.0f : clip);  // a norm that is no number stays one in the factor
  }
}

// One step of AdamW on param, m, v [n] by grad [n] (null: zeros) times clip[1] (null: 1). A work-item per element.
//   m += (1 - beta1) (g - m)   v += (1 - beta2) (g^2 - v)   param -= decay * param + rate * m / (root * sqrt(v) + eps)
// new1 = 1 - beta1, new2 = 1 - beta2, decay = lr * weight decay, rate = lr / (1 - beta1^t), root = 1 / sqrt(1 - beta2^t). The
// decay is subtracted with the update: param * (1 - decay) first would round the small decay to 24 bits of 1.
kernel void adamw_step(global float* restrict param, global const float* restrict grad, global float* restrict m,
                       global float* restrict v, global const float* restrict clip, int n, float new1, float new2,
                       float eps, float decay, float rate, float root) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const float g = grad ? grad[i] * (clip ? clip[1] : 1.0f) : 0.0f;
  const float first = FMA(new1, g - m[i], m[i]);
  const float second = FMA(new2, g * g - v[i], v[i]);
  m[i] = first;
  v[i] = second;
  param[i] -= FMA(decay, param[i], rate * first / FMA(root, sqrt(second), eps));
}

// average [n] += part * (param - average)
kernel void adamw_average(global float* restrict average, global const float* restrict param, int n, float part) {
  const int i = get_global_id(0);
  if (i < n) average[i] = FMA(part, param[i] - average[i], average[i]);
}
