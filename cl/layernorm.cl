// LayerNorm over the last axis, biased variance in two passes, eps inside the root.
//   x [R, C], gamma, beta [C], out [R, C]; out may be x.   out = (x - mean) / sqrt(var + eps) * gamma + beta
// Modulated: out [V, P, C] from x [V, 1 + P, C], whose first token of each view is dropped, and shift, scale side by
// side in
//   film [V P, 2 C] (shift first).   out = LayerNorm(x) * (1 + scale) + shift
// The plain call is skip = 0 with P = R and V = 1; film is null then. Row r of out is row (r / P) * (P + skip) + r % P
// + skip of x. layernorm_cpu: one work-item per row, float16 over the channels. layernorm_gpu: one work-group of 64 per
// row, sums through local memory.
#include "common.clh"

static inline float sum_of(float16 v) {
  const float8 a = v.lo + v.hi;
  const float4 b = a.lo + a.hi;
  const float2 c = b.lo + b.hi;
  return c.x + c.y;
}

__kernel void layernorm_cpu(__global const float* x, __global const float* gamma, __global const float* beta,
                            __global const float* film, __global float* out, int R, int C, int P, int skip, float eps) {
  const int r = get_global_id(0);
  if (r >= R) return;
  __global const float* from = x + ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  __global float* to = out + (size_t)r * C;
  const int whole = C & ~15;
  float16 sums = (float16)(0.0f);
  for (int c = 0; c < whole; c += 16) sums += vload16(0, from + c);
  float sum = sum_of(sums);
  for (int c = whole; c < C; ++c) sum += from[c];
  const float mean = sum / C;
  sums = (float16)(0.0f);
  for (int c = 0; c < whole; c += 16) {
    const float16 d = vload16(0, from + c) - mean;
    sums += d * d;
  }
  float square = sum_of(sums);
  for (int c = whole; c < C; ++c) square += (from[c] - mean) * (from[c] - mean);
  const float by = 1.0f / sqrt(square / C + eps);
  if (film) {
    __global const float* shift = film + (size_t)r * 2 * C;
    __global const float* scale = shift + C;
    for (int c = 0; c < whole; c += 16) {
      const float16 n = (vload16(0, from + c) - mean) * by * vload16(0, gamma + c) + vload16(0, beta + c);
      vstore16(n * (1.0f + vload16(0, scale + c)) + vload16(0, shift + c), 0, to + c);
    }
    for (int c = whole; c < C; ++c) to[c] = ((from[c] - mean) * by * gamma[c] + beta[c]) * (1.0f + scale[c]) + shift[c];
  } else {
    for (int c = 0; c < whole; c += 16)
      vstore16((vload16(0, from + c) - mean) * by * vload16(0, gamma + c) + vload16(0, beta + c), 0, to + c);
    for (int c = whole; c < C; ++c) to[c] = (from[c] - mean) * by * gamma[c] + beta[c];
  }
}

#define GROUP 64

static float group_sum(float mine, __local float* part) {
  const int item = get_local_id(0);
  part[item] = mine;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int half_ = GROUP / 2; half_ > 0; half_ /= 2) {
    if (item < half_) part[item] += part[item + half_];
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  const float sum = part[0];
  barrier(CLK_LOCAL_MEM_FENCE);
  return sum;
}

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void layernorm_gpu(
    __global const float* x, __global const float* gamma, __global const float* beta, __global const float* film,
    __global float* out, int R, int C, int P, int skip, float eps) {
  __local float part[GROUP];
  const int r = get_group_id(0), item = get_local_id(0);
  __global const float* from = x + ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  __global float* to = out + (size_t)r * C;
  float sum = 0.0f;
  for (int c = item; c < C; c += GROUP) sum += from[c];
  const float mean = group_sum(sum, part) / C;
  float square = 0.0f;
  for (int c = item; c < C; c += GROUP) square += (from[c] - mean) * (from[c] - mean);
  const float by = 1.0f / sqrt(group_sum(square, part) / C + eps);
  for (int c = item; c < C; c += GROUP) {
    const float n = (from[c] - mean) * by * gamma[c] + beta[c];
    to[c] = film ? n * (1.0f + film[(size_t)r * 2 * C + C + c]) + film[(size_t)r * 2 * C + c] : n;
  }
}
