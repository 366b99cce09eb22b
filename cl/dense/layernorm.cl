// LayerNorm over the last axis, with the biased variance in two passes and eps inside the root:
//   out = n gamma + beta, n = (x - mean) / sqrt(var + eps)
// Modulated (if film is given): out = (n gamma + beta) (1 + scale) + shift, and the first `skip` tokens of each view
// are dropped. Row r of out comes from row (r / P) (P + skip) + r % P + skip of x. The plain call has skip = 0 and P =
// R.
// ```
// argument     type  shape   what
// x            f32   [R,C]   modulated: [V,skip+P,C] with R = V P
// gamma, beta  f32   [C]     weights; null: ones and zeros (not allowed with film)
// film         f32   [R,2C]  shift, then scale, of each row of out; null: not modulated
// out          f32   [R,C]   written; plain: may be x
// work-items   cpu: one per row; gpu: groups of 64, one per row
// ```
// Backward, with u = dy (1 + scale) or u = dy, and g = u gamma:
//   dx     = (g - mean(g) - n mean(g n)) / sqrt(var + eps)
//   dshift = dy                      dscale = dy (n gamma + beta)
//   dgamma = sum over rows of u n    dbeta  = sum over rows of u
// ```
// argument    type  shape   what
// dy          f32   [R,C]   gradient of out
// dx          f32   as x    written, or added to if `add` is not 0; dropped rows get zeros if it is written
// dfilm       f32   [R,2C]  written if film is given
// stats       f32   [R,2]   written: each row's mean and 1 / sqrt(var + eps), for the next kernel
// work-items  cpu: one per row; gpu: groups of 64, one per row
// ```
#include "common.clh"
#include "vector16.clh"

// (mean, 1 / sqrt(var + eps)) of a row, computed by one work-item.
static inline float2 statistics(global const float* x, int C, float eps) {
  const int whole = C & ~15;
  float16 sums = (float16)(0.0f);
  for (int c = 0; c < whole; c += 16) sums += vload16(0, x + c);
  float sum = sum_of(sums);
  for (int c = whole; c < C; ++c) sum += x[c];
  const float mean = sum / C;
  sums = (float16)(0.0f);
  for (int c = 0; c < whole; c += 16) {
    const float16 d = vload16(0, x + c) - mean;
    sums += d * d;
  }
  float square = sum_of(sums);
  for (int c = whole; c < C; ++c) square += (x[c] - mean) * (x[c] - mean);
  return (float2)(mean, 1.0f / sqrt(square / C + eps));
}

kernel void layernorm_forward_cpu(global const float* x, global const float* gamma, global const float* beta,
                                  global const float* film, global float* out, int R, int C, int P, int skip,
                                  float eps) {
  const int r = get_global_id(0);
  if (r >= R) return;
  global const float* from = x + ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  global float* to = out + (size_t)r * C;
  const int whole = C & ~15;
  const float2 s = statistics(from, C, eps);
  const float mean = s.x, by = s.y;
  if (film) {
    global const float* shift = film + (size_t)r * 2 * C;
    global const float* scale = shift + C;
    for (int c = 0; c < whole; c += 16) {
      const float16 n = (vload16(0, from + c) - mean) * by * vload16(0, gamma + c) + vload16(0, beta + c);
      vstore16(n * (1.0f + vload16(0, scale + c)) + vload16(0, shift + c), 0, to + c);
    }
    for (int c = whole; c < C; ++c) to[c] = ((from[c] - mean) * by * gamma[c] + beta[c]) * (1.0f + scale[c]) + shift[c];
  } else {
    for (int c = 0; c < whole; c += 16) {
      float16 n = (vload16(0, from + c) - mean) * by;
      if (gamma) n = n * vload16(0, gamma + c) + vload16(0, beta + c);
      vstore16(n, 0, to + c);
    }
    for (int c = whole; c < C; ++c) {
      const float n = (from[c] - mean) * by;
      to[c] = gamma ? n * gamma[c] + beta[c] : n;
    }
  }
}

// u of sixteen channels from c on: dy, times 1 + scale if scale is not null.
static inline float16 upstream(global const float* dy, global const float* scale, int c, int width) {
  const float16 u = load_part(dy + c, width);
  return scale ? u * (1.0f + load_part(scale + c, width)) : u;
}

kernel void layernorm_backward_cpu(global const float* x, global const float* gamma, global const float* beta,
                                   global const float* film, global const float* dy, global float* dx,
                                   global float* dfilm, global float* stats, int R, int C, int P, int skip, float eps,
                                   int add) {
  const int r = get_global_id(0);
  if (r >= R) return;
  const size_t at = ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  const float2 s = statistics(x + at, C, eps);
  vstore2(s, r, stats);
  global const float* up = dy + (size_t)r * C;
  global const float* scale = film ? film + (size_t)r * 2 * C + C : film;
  float16 sums = (float16)(0.0f), dots = (float16)(0.0f);
  for (int c = 0; c < C; c += 16) {
    const int width = C - c;
    const float16 n = (load_part(x + at + c, width) - s.x) * s.y;
    const float16 by = gamma ? load_part(gamma + c, width) : (float16)(1.0f);
    const float16 g = upstream(up, scale, c, width) * by;
    sums += g;
    dots += g * n;
    if (film) {
      const float16 u = load_part(up + c, width);
      global float* to = dfilm + (size_t)r * 2 * C + c;
      store_part(u, width, to);
      store_part(u * (n * by + load_part(beta + c, width)), width, to + C);
    }
  }
  const float sum = sum_of(sums) / C, dot_ = sum_of(dots) / C;
  for (int c = 0; c < C; c += 16) {
    const int width = C - c;
    const float16 n = (load_part(x + at + c, width) - s.x) * s.y;
    const float16 by = gamma ? load_part(gamma + c, width) : (float16)(1.0f);
    float16 d = (upstream(up, scale, c, width) * by - sum - n * dot_) * s.y;
    if (add) d += load_part(dx + at + c, width);
    store_part(d, width, dx + at + c);
  }
  if (r % P == 0 && !add)
    for (int c = 0; c < skip * C; ++c) dx[at - (size_t)skip * C + c] = 0.0f;
}

#define GROUP 64

// Functions with barriers that Mesa 25's rusticl must not call: it crashes.
#define WITH_BARRIERS static inline __attribute__((always_inline))

// The sum over the group in a fixed order. It holds barriers, so every work-item must call it. part [GROUP]: local
// memory.
WITH_BARRIERS float group_sum(float mine, local float* part) {
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

// statistics() by a whole group.
WITH_BARRIERS float2 group_statistics(global const float* x, int C, float eps, local float* part) {
  const int item = get_local_id(0);
  float sum = 0.0f;
  for (int c = item; c < C; c += GROUP) sum += x[c];
  const float mean = group_sum(sum, part) / C;
  float square = 0.0f;
  for (int c = item; c < C; c += GROUP) square += (x[c] - mean) * (x[c] - mean);
  return (float2)(mean, 1.0f / sqrt(group_sum(square, part) / C + eps));
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void layernorm_forward_gpu(
    global const float* x, global const float* gamma, global const float* beta, global const float* film,
    global float* out, int R, int C, int P, int skip, float eps) {
  local float part[GROUP];
  const int r = GROUP_ID(0), item = get_local_id(0);
  global const float* from = x + ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  global float* to = out + (size_t)r * C;
  const float2 s = group_statistics(from, C, eps, part);
  const float mean = s.x, by = s.y;
  for (int c = item; c < C; c += GROUP) {
    const float plain = (from[c] - mean) * by, n = gamma ? plain * gamma[c] + beta[c] : plain;
    to[c] = film ? n * (1.0f + film[(size_t)r * 2 * C + C + c]) + film[(size_t)r * 2 * C + c] : n;
  }
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void layernorm_backward_gpu(
    global const float* x, global const float* gamma, global const float* beta, global const float* film,
    global const float* dy, global float* dx, global float* dfilm, global float* stats, int R, int C, int P, int skip,
    float eps, int add) {
  local float part[GROUP];
  const int r = GROUP_ID(0), item = get_local_id(0);
  const size_t at = ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
  const float2 s = group_statistics(x + at, C, eps, part);
  if (item == 0) vstore2(s, r, stats);
  global const float* up = dy + (size_t)r * C;
  global const float* scale = film ? film + (size_t)r * 2 * C + C : film;
  float sum = 0.0f, dot_ = 0.0f;
  for (int c = item; c < C; c += GROUP) {
    const float n = (x[at + c] - s.x) * s.y;
    const float g = up[c] * (scale ? 1.0f + scale[c] : 1.0f) * (gamma ? gamma[c] : 1.0f);
    sum += g;
    dot_ += g * n;
    if (film) {
      dfilm[(size_t)r * 2 * C + c] = up[c];
      dfilm[(size_t)r * 2 * C + C + c] = up[c] * (n * gamma[c] + beta[c]);
    }
  }
  sum = group_sum(sum, part) / C;
  dot_ = group_sum(dot_, part) / C;
  for (int c = item; c < C; c += GROUP) {
    const float n = (x[at + c] - s.x) * s.y;
    const float d = (up[c] * (scale ? 1.0f + scale[c] : 1.0f) * (gamma ? gamma[c] : 1.0f) - sum - n * dot_) * s.y;
    dx[at + c] = add ? dx[at + c] + d : d;
  }
  if (r % P == 0 && !add)
    for (int c = item; c < skip * C; c += GROUP) dx[at - (size_t)skip * C + c] = 0.0f;
}

#ifndef ROWS
#define ROWS 64
#endif

// dgamma and dbeta begin with the sums over ROWS rows each; column_sum adds these up.
// ```
// argument       type  shape             what
// x, film, dy    f32                     as above
// stats          f32   [R,2]             from layernorm's backward
// dgamma, dbeta  f32   [ceil(R/ROWS),C]  written
// define ROWS    64                      rows of a sum
// work-items     gpu: (channel, ROWS rows); cpu: groups of one, one per ROWS rows
// ```
kernel void layernorm_backward_columns_gpu(global const float* x, global const float* film, global const float* dy,
                                           global const float* stats, global float* dgamma, global float* dbeta, int R,
                                           int C, int P, int skip) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  if (c >= C) return;
  float by_gamma = 0.0f, by_beta = 0.0f;
  for (int r = chunk * ROWS; r < min(R, (chunk + 1) * ROWS); ++r) {
    const size_t at = ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
    const float n = (x[at + c] - stats[2 * r]) * stats[2 * r + 1];
    const float u = dy[(size_t)r * C + c] * (film ? 1.0f + film[(size_t)r * 2 * C + C + c] : 1.0f);
    by_gamma += u * n;
    by_beta += u;
  }
  dgamma[(size_t)chunk * C + c] = by_gamma;
  dbeta[(size_t)chunk * C + c] = by_beta;
}

kernel void layernorm_backward_columns_cpu(global const float* x, global const float* film, global const float* dy,
                                           global const float* stats, global float* dgamma, global float* dbeta, int R,
                                           int C, int P, int skip) {
  const int chunk = GROUP_ID(0), until = min(R, (chunk + 1) * ROWS);
  global const float* none = 0;
  for (int c = 0; c < C; c += 16) {
    const int width = min(16, C - c);
    float16 by_gamma = 0.0f, by_beta = 0.0f;
    for (int r = chunk * ROWS; r < until; ++r) {
      const size_t at = ((size_t)(r / P) * (P + skip) + r % P + skip) * C;
      const float16 n = (load_part(x + at + c, width) - stats[2 * r]) * stats[2 * r + 1];
      const float16 u = upstream(dy + (size_t)r * C, film ? film + (size_t)r * 2 * C + C : none, c, width);
      by_gamma += u * n;
      by_beta += u;
    }
    store_part(by_gamma, width, dgamma + (size_t)chunk * C + c);
    store_part(by_beta, width, dbeta + (size_t)chunk * C + c);
  }
}
