// GroupNorm's statistics over all rows of a channels-last tensor, as one scale and one shift per channel. The next
// reader of the tensor applies them while loading (composed rows, see compose_rows.cl): y = x * scale + shift.
// ```
// argument                  type  shape       what
// x                         f32   [N,width]   one of at most two tensors whose channels stand side by side; its
//                                             channels are `channel` .. channel + width - 1 of the C, which are in G
//                                             groups of consecutive ones
// mean, m2                  f32   [chunks,C]  written: each chunk's mean and sum of (x - mean)^2 over its `rows` rows
// channel_mean, channel_m2  f32   [C]         written: the same over all rows
// gamma, beta               f32   [C]         weights
// scale                     f32   [C]         written: gamma / sqrt(var + eps), with the biased variance of the
//                                             channel's group
// shift                     f32   [C]         written: beta - mean * scale, with the mean of the channel's group
// ```
// There are three steps, each with a fixed order of additions, and none subtracts large squares: the statistics of
// every chunk of rows and channel; their merge over the chunks; the merge over a group's channels. A merge is always
// sum (m2_i + n_i (mean_i - mean)^2).
#include "tile_cpu.clh"

// Rows that are reduced in registers before they are merged into the running mean and m2.
#define ROWS 8

// Merges ROWS rows r0 .. r7 of type T into mean and m2 of n earlier rows. share = ROWS / (n + ROWS).
#define MERGE(T, mean, m2, r0, r1, r2, r3, r4, r5, r6, r7, n, share)                                             \
  {                                                                                                              \
    const T block =                                                                                              \
        r0 + (((r1 - r0) + (r2 - r0)) + ((r3 - r0) + (r4 - r0)) + ((r5 - r0) + (r6 - r0)) + (r7 - r0)) * 0.125f; \
    const T d0 = r0 - block, d1 = r1 - block, d2 = r2 - block, d3 = r3 - block;                                  \
    const T d4 = r4 - block, d5 = r5 - block, d6 = r6 - block, d7 = r7 - block;                                  \
    const T away = block - mean;                                                                                 \
    mean += away * share;                                                                                        \
    m2 += ((d0 * d0 + d1 * d1) + (d2 * d2 + d3 * d3)) + ((d4 * d4 + d5 * d5) + (d6 * d6 + d7 * d7)) +            \
          away * away * (share * n);                                                                             \
  }

// Merges one more row v into mean and m2 of n earlier rows.
#define MERGE_ONE(T, mean, m2, v, n)        \
  {                                         \
    const T away = v - mean;                \
    const float share_one = 1.0f / (n + 1); \
    mean += away * share_one;               \
    m2 += away * away * (n * share_one);    \
  }

// cpu flavour: one work-item per chunk, which streams along the rows.
kernel void groupnorm_forward_chunks_cpu(global const float* restrict x, global float* restrict mean,
                                         global float* restrict m2, int N, int width, int channel, int C, int rows) {
  const int chunk = get_global_id(0);
  const long first = (long)chunk * rows;
  if (first >= N) return;
  const int count = (int)min((long)rows, N - first);
  global const float* restrict in = x + first * width;
  global float* restrict out_mean = mean + (long)chunk * C + channel;
  global float* restrict out_m2 = m2 + (long)chunk * C + channel;
  for (int c = 0; c < width; ++c) out_mean[c] = in[c], out_m2[c] = 0.0f;
  int row = 0;
  for (; row + ROWS <= count; row += ROWS) {
    global const float* restrict p = in + (long)row * width;
    const float n = (float)row, share = row == 0 ? 1.0f : ROWS / (n + ROWS);
    int c = 0;
    for (; c + 16 <= width; c += 16) {
      float16 a = vload16(0, out_mean + c), b = vload16(0, out_m2 + c);
      const float16 r0 = vload16(0, p + c), r1 = vload16(0, p + width + c), r2 = vload16(0, p + 2 * width + c),
                    r3 = vload16(0, p + 3 * width + c), r4 = vload16(0, p + 4 * width + c),
                    r5 = vload16(0, p + 5 * width + c), r6 = vload16(0, p + 6 * width + c),
                    r7 = vload16(0, p + 7 * width + c);
      MERGE(float16, a, b, r0, r1, r2, r3, r4, r5, r6, r7, n, share)
      vstore16(a, 0, out_mean + c);
      vstore16(b, 0, out_m2 + c);
    }
    for (; c < width; ++c) {
      float a = out_mean[c], b = out_m2[c];
      MERGE(float, a, b, p[c], p[width + c], p[2 * width + c], p[3 * width + c], p[4 * width + c], p[5 * width + c],
            p[6 * width + c], p[7 * width + c], n, share)
      out_mean[c] = a;
      out_m2[c] = b;
    }
  }
  for (; row < count; ++row) {
    global const float* restrict p = in + (long)row * width;
    for (int c = 0; c < width; ++c) {
      float a = out_mean[c], b = out_m2[c];
      MERGE_ONE(float, a, b, p[c], (float)row)
      out_mean[c] = a;
      out_m2[c] = b;
    }
  }
}

// gpu flavour: work-items (channel of x, chunk), so that neighbours read neighbours.
kernel void groupnorm_forward_chunks_gpu(global const float* restrict x, global float* restrict mean,
                                         global float* restrict m2, int N, int width, int channel, int C, int rows) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  const long first = (long)chunk * rows;
  if (c >= width || first >= N) return;
  const int count = (int)min((long)rows, N - first);
  global const float* restrict p = x + first * width + c;
  float a = p[0], b = 0.0f;
  int row = 0;
  for (; row + ROWS <= count; row += ROWS, p += (long)ROWS * width) {
    const float n = (float)row, share = row == 0 ? 1.0f : ROWS / (n + ROWS);
    const float r0 = p[0], r1 = p[width], r2 = p[2 * width], r3 = p[3 * width], r4 = p[4 * width], r5 = p[5 * width],
                r6 = p[6 * width], r7 = p[7 * width];
    MERGE(float, a, b, r0, r1, r2, r3, r4, r5, r6, r7, n, share)
  }
  for (; row < count; ++row, p += width) MERGE_ONE(float, a, b, p[0], (float)row)
  mean[(long)chunk * C + channel + c] = a;
  m2[(long)chunk * C + channel + c] = b;
}

// Over the chunks: one work-item per channel. N >= 1.
kernel void groupnorm_forward_channels(global const float* restrict mean, global const float* restrict m2,
                                       global float* restrict channel_mean, global float* restrict channel_m2, int N,
                                       int C, int rows, int chunks) {
  const int c = get_global_id(0);
  if (c >= C) return;
  const float first = mean[c];
  const float last_rows = (float)(N - (chunks - 1) * rows);
  float away = 0.0f;
  for (int i = 1; i < chunks; ++i) away += (i + 1 < chunks ? (float)rows : last_rows) * (mean[(long)i * C + c] - first);
  const float centre = first + away / (float)N;
  float sum = 0.0f;
  for (int i = 0; i < chunks; ++i) {
    const float d = mean[(long)i * C + c] - centre;
    sum += m2[(long)i * C + c] + (i + 1 < chunks ? (float)rows : last_rows) * d * d;
  }
  channel_mean[c] = centre;
  channel_m2[c] = sum;
}

// Over a group's channels, computed again for each of them: one work-item per channel. N = 0: mean and variance count
// as 0. out_mean, out_rstd [C]: written for the backward, the mean and 1 / sqrt(var + eps) of the channel's group;
// null: not written.
kernel void groupnorm_forward_scale(global const float* restrict channel_mean, global const float* restrict channel_m2,
                                    global const float* restrict gamma, global const float* restrict beta,
                                    global float* restrict scale, global float* restrict shift,
                                    global float* restrict out_mean, global float* restrict out_rstd, int N, int C,
                                    int G, float eps) {
  const int c = get_global_id(0);
  if (c >= C) return;
  float mean = 0.0f, variance = 0.0f;
  if (N > 0) {
    const int size = C / G, begin = c / size * size;
    const float first = channel_mean[begin];
    float away = 0.0f;
    for (int i = 1; i < size; ++i) away += channel_mean[begin + i] - first;
    mean = first + away / (float)size;
    for (int i = 0; i < size; ++i) {
      const float d = channel_mean[begin + i] - mean;
      variance += channel_m2[begin + i] / (float)N + d * d;
    }
    variance /= (float)size;
  }
  const float s = gamma[c] / sqrt(variance + eps);
  scale[c] = s;
  shift[c] = beta[c] - mean * s;
  if (out_mean) out_mean[c] = mean;
  if (out_rstd) out_rstd[c] = 1.0f / sqrt(variance + eps);
}

// Backward of y = silu(z), z = x * scale + shift = gamma u + beta with u = (x - mean) rstd:
//   dz = dy silu'(z);  dbeta = sum over rows of dz, dgamma = sum of dz u;
//   dx = rstd (gamma dz - (sum over the group of gamma dbeta + u * sum of gamma dgamma) / (N C / G))
// ```
// argument                      type  shape       what
// x                             f32   [N,width]   one of the tensors, as above
// dy                            f32   [N,C]       gradient of y
// scale, shift                  f32   [C]         from groupnorm_forward_scale
// mean, rstd                    f32   [C]         from groupnorm_forward_scale: its out_mean and out_rstd
// sums, sums_u                  f32   [chunks,C]  written: sums of dz and dz u over a chunk's rows
// channel_sums, channel_sums_u  f32   [C]         written: the same over all rows
// dgamma, dbeta                 f32   [C]         added to
// group_mean, group_mean_u      f32   [C]         written: means of gamma dz and gamma dz u over the channel's group
// dx                            f32   [N,width]   written, or added to if `add` is not 0; may be dy if width is C
// ```
// Sums are taken over ROWS rows, then over these within a chunk, then over the chunks, then over a group's channels.
static inline float silu_slope(float z) {
  const float s = sigmoid(z);
  return s * (1.0f + z * (1.0f - s));
}
static inline float16 silu_slope_16(float16 z) {
  const float16 s = 1.0f / (1.0f + exp_16(-z));
  return s * (1.0f + z * (1.0f - s));
}

// cpu flavour: one work-item per chunk.
kernel void groupnorm_backward_chunks_cpu(global const float* restrict x, global const float* restrict dy,
                                          global const float* restrict scale, global const float* restrict shift,
                                          global const float* restrict mean, global const float* restrict rstd,
                                          global float* restrict sums, global float* restrict sums_u, int N, int width,
                                          int channel, int C, int rows) {
  const int chunk = get_global_id(0);
  const long first = (long)chunk * rows;
  if (first >= N) return;
  const int count = (int)min((long)rows, N - first);
  global float* restrict out = sums + (long)chunk * C + channel;
  global float* restrict out_u = sums_u + (long)chunk * C + channel;
  for (int row = 0; row < count; row += ROWS) {
    const int until = min(row + ROWS, count);
    for (int c = 0; c < width; c += 16) {
      const int part = min(16, width - c), at = channel + c;
      const float16 a = load_part(scale + at, part), b = load_part(shift + at, part);
      const float16 m = load_part(mean + at, part), r = load_part(rstd + at, part);
      float16 sum = (float16)(0.0f), sum_u = (float16)(0.0f);
      for (int i = row; i < until; ++i) {
        const float16 v = load_part(x + (first + i) * width + c, part);
        const float16 dz = load_part(dy + (first + i) * C + at, part) * silu_slope_16(FMA(v, a, b));
        sum += dz;
        sum_u += dz * ((v - m) * r);
      }
      if (row > 0) sum += load_part(out + c, part), sum_u += load_part(out_u + c, part);
      store_part(sum, part, out + c);
      store_part(sum_u, part, out_u + c);
    }
  }
}

// gpu flavour: work-items (channel of x, chunk).
kernel void groupnorm_backward_chunks_gpu(global const float* restrict x, global const float* restrict dy,
                                          global const float* restrict scale, global const float* restrict shift,
                                          global const float* restrict mean, global const float* restrict rstd,
                                          global float* restrict sums, global float* restrict sums_u, int N, int width,
                                          int channel, int C, int rows) {
  const int c = get_global_id(0), chunk = get_global_id(1), at = channel + c;
  const long first = (long)chunk * rows;
  if (c >= width || first >= N) return;
  const int count = (int)min((long)rows, N - first);
  const float a = scale[at], b = shift[at], m = mean[at], r = rstd[at];
  float total = 0.0f, total_u = 0.0f;
  for (int row = 0; row < count; row += ROWS) {
    const int until = min(row + ROWS, count);
    float sum = 0.0f, sum_u = 0.0f;
    for (int i = row; i < until; ++i) {
      const float v = x[(first + i) * width + c];
      const float dz = dy[(first + i) * C + at] * silu_slope(FMA(v, a, b));
      sum += dz;
      sum_u += dz * ((v - m) * r);
    }
    total += sum;
    total_u += sum_u;
  }
  sums[(long)chunk * C + at] = total;
  sums_u[(long)chunk * C + at] = total_u;
}

// Over the chunks: one work-item per channel.
kernel void groupnorm_backward_channels(global const float* restrict sums, global const float* restrict sums_u,
                                        global float* restrict channel_sums, global float* restrict channel_sums_u,
                                        global float* restrict dgamma, global float* restrict dbeta, int C,
                                        int chunks) {
  const int c = get_global_id(0);
  if (c >= C) return;
  float sum = 0.0f, sum_u = 0.0f;
  for (int i = 0; i < chunks; ++i) sum += sums[(long)i * C + c], sum_u += sums_u[(long)i * C + c];
  channel_sums[c] = sum;
  channel_sums_u[c] = sum_u;
  dbeta[c] += sum;
  dgamma[c] += sum_u;
}

// Over a group's channels, computed again for each of them: one work-item per channel.
kernel void groupnorm_backward_groups(global const float* restrict channel_sums,
                                      global const float* restrict channel_sums_u, global const float* restrict gamma,
                                      global float* restrict group_mean, global float* restrict group_mean_u, int N,
                                      int C, int G) {
  const int c = get_global_id(0);
  if (c >= C) return;
  const int size = C / G, begin = c / size * size;
  float sum = 0.0f, sum_u = 0.0f;
  for (int i = begin; i < begin + size; ++i) {
    sum += gamma[i] * channel_sums[i];
    sum_u += gamma[i] * channel_sums_u[i];
  }
  group_mean[c] = sum / ((float)N * (float)size);
  group_mean_u[c] = sum_u / ((float)N * (float)size);
}

// cpu flavour: one work-item per row.
kernel void groupnorm_backward_cpu(global const float* x, global const float* dy, global const float* scale,
                                   global const float* shift, global const float* mean, global const float* rstd,
                                   global const float* gamma, global const float* group_mean,
                                   global const float* group_mean_u, global float* dx, int add, int N, int width,
                                   int channel, int C) {
  const int row = get_global_id(0);
  if (row >= N) return;
  for (int c = 0; c < width; c += 16) {
    const int part = min(16, width - c), at = channel + c;
    const float16 v = load_part(x + (long)row * width + c, part), r = load_part(rstd + at, part);
    const float16 z = FMA(v, load_part(scale + at, part), load_part(shift + at, part));
    const float16 dz = load_part(dy + (long)row * C + at, part) * silu_slope_16(z);
    const float16 u = (v - load_part(mean + at, part)) * r;
    float16 d = r * (load_part(gamma + at, part) * dz - load_part(group_mean + at, part) -
                     u * load_part(group_mean_u + at, part));
    global float* to = dx + (long)row * width + c;
    if (add) d += load_part(to, part);
    store_part(d, part, to);
  }
}

// gpu flavour: one work-item per element.
kernel void groupnorm_backward_gpu(global const float* x, global const float* dy, global const float* scale,
                                   global const float* shift, global const float* mean, global const float* rstd,
                                   global const float* gamma, global const float* group_mean,
                                   global const float* group_mean_u, global float* dx, int add, int N, int width,
                                   int channel, int C) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)N * width) return;
  const size_t row = i / width;
  const int at = channel + (int)(i % width);
  const float v = x[i];
  const float dz = dy[row * C + at] * silu_slope(FMA(v, scale[at], shift[at]));
  const float u = (v - mean[at]) * rstd[at];
  const float d = rstd[at] * (gamma[at] * dz - group_mean[at] - u * group_mean_u[at]);
  dx[i] = add ? dx[i] + d : d;
}
