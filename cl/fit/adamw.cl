// The optimiser: AdamW, the norm of all gradients together with the factor that clips it, and a moving average of the
// weights.
// ```
// define        default  what
// define GROUP  64       work-items of a group, a power of two
// define EACH   32       elements of a work-item in adamw_squares
// ```
#include "common.clh"
#include "vector16.clh"

#ifndef GROUP
#define GROUP 64
#endif
#ifndef EACH
#define EACH 32
#endif

// The sum over the group in a fixed order. It holds a barrier, so every work-item must call it. part [GROUP]: local
// memory.
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

// Sums of squares of one tensor's gradient, in blocks of GROUP * EACH elements.
// ```
// argument    type  shape  what
// grad        f32   [n]    gradient
// sums        f32   [..]   written: one number per block, from sums[first] on
// work-items  gpu: groups of GROUP, one per block; cpu (below): groups of one, one per block
// ```
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void adamw_squares(global const float* restrict grad,
                                                                             global float* restrict sums, int n,
                                                                             int first) {
  local float part[GROUP];
  const int block = GROUP_ID(0);
  global const float* from = grad + (size_t)block * GROUP * EACH;
  const int left = min(n - block * (GROUP * EACH), GROUP * EACH);
  float sum = 0.0f;
  for (int i = get_local_id(0); i < left; i += GROUP) sum = FMA(from[i], from[i], sum);
  sum = group_sum(sum, part);
  if (get_local_id(0) == 0) sums[first + block] = sum;
}

kernel void adamw_squares_cpu(global const float* restrict grad, global float* restrict sums, int n, int first) {
  const int block = GROUP_ID(0), from = block * (GROUP * EACH), left = min(n - from, GROUP * EACH);
  float16 a = 0.0f, b = 0.0f;
  for (int i = 0; i < left; i += 32) {
    const float16 x = load_part(grad + from + i, left - i), y = load_part(grad + from + i + 16, left - i - 16);
    a = FMA(x, x, a);
    b = FMA(y, y, b);
  }
  sums[first + block] = sum_of(a + b);
}

// ```
// argument    type   shape    what
// sums        f32    [count]  sums of squares of all tensors
// out         f32    [2]      written: norm = scale * sqrt(total), and the factor for the gradients as they are stored,
//                             scale * min(1, max_norm / (norm + 1e-6))
// scale       float           factor from the stored gradients to the true ones
// work-items  one group of GROUP
// ```
// Kahan's summation, so that the error does not grow with count.
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
    out[1] = scale * (clip > 1.0f ? 1.0f : clip);  // a norm that is NaN stays NaN in the factor
  }
}

// One step of AdamW:
//   m += (1 - beta1) (g - m)   v += (1 - beta2) (g^2 - v)   param -= decay * param + rate * m / (root * sqrt(v) + eps)
// ```
// argument     type   shape  what
// param, m, v  f32    [n]    in place: the weights and the two moments
// grad         f32    [n]    gradient as stored; null: zeros
// clip         f32    [2]    from adamw_clip, clip[1] is the factor; null: 1
// new1, new2   float         1 - beta1, 1 - beta2
// decay        float         learning rate times weight decay
// rate         float         learning rate / (1 - beta1^t), t: the number of the step from 1
// root         float         1 / sqrt(1 - beta2^t)
// work-items   one per element
// ```
// The decay is subtracted together with the update: param * (1 - decay) first would round the small decay to 24 bits of
// 1.
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

// ```
// argument    type  shape  what
// average     f32   [n]    in place: += part * (param - average)
// param       f32   [n]    weights
// work-items  one per element
// ```
kernel void adamw_average(global float* restrict average, global const float* restrict param, int n, float part) {
  const int i = get_global_id(0);
  if (i < n) average[i] = FMA(part, param[i] - average[i], average[i]);
}
