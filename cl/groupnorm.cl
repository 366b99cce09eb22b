// GroupNorm's statistics over all rows of a channels-last tensor, folded into one scale and one shift per channel, which whoever
// reads the tensor next applies while loading: y = x * scale + shift.
//   x [N,C0] and, side by side with it, optionally x1 [N,C1]; C = C0 + C1 channels in G groups of consecutive ones (f32)
//   gamma, beta [C]   scale = gamma / sqrt(var + eps), shift = beta - mean * scale, with a group's mean and biased variance
// Three steps, each with a fixed order of additions, none of which subtracts large squares: the rows are cut in chunks; every chunk
// and channel gets its mean and m2 = sum (x - mean)^2; these are merged over the chunks, then over a group's channels, always by
// sum (m2_i + n_i (mean_i - mean)^2).
//   mean, m2 [chunks, C] of the chunks; channel_mean, channel_m2 [C]
// groupnorm_chunks_cpu and _gpu compute the same; the first keeps one work-item at a chunk (it streams along rows), the second takes
// a work-item per channel and chunk (neighbours read neighbours).

// Rows that are reduced in registers before they are merged into the running mean and m2.
#define ROWS 8

// Merges ROWS rows r0..r7 of type T, seen before: n rows of the given mean and m2. `share` = ROWS / (n + ROWS).
#define MERGE(T, mean, m2, r0, r1, r2, r3, r4, r5, r6, r7, n, share)                                           \
  {                                                                                                             \
    const T block = r0 + (((r1 - r0) + (r2 - r0)) + ((r3 - r0) + (r4 - r0)) + ((r5 - r0) + (r6 - r0)) + (r7 - r0)) * 0.125f; \
    const T d0 = r0 - block, d1 = r1 - block, d2 = r2 - block, d3 = r3 - block;                                  \
    const T d4 = r4 - block, d5 = r5 - block, d6 = r6 - block, d7 = r7 - block;                                  \
    const T away = block - mean;                                                                                \
    mean += away * share;                                                                                       \
    m2 += ((d0 * d0 + d1 * d1) + (d2 * d2 + d3 * d3)) + ((d4 * d4 + d5 * d5) + (d6 * d6 + d7 * d7)) +            \
          away * away * (share * n);                                                                            \
  }

// One more row v after n others.
#define MERGE_ONE(T, mean, m2, v, n)        \
  {                                         \
    const T away = v - mean;                \
    const float share_one = 1.0f / (n + 1); \
    mean += away * share_one;               \
    m2 += away * away * (n * share_one);    \
  }

// x [N,width] is one of the sources; its channels start at `channel` of the C. A work-item per chunk of `rows` rows.
__kernel void groupnorm_chunks_cpu(__global const float* restrict x, __global float* restrict mean, __global float* restrict m2, int N,
                                   int width, int channel, int C, int rows) {
  const int chunk = get_global_id(0);
  const long first = (long)chunk * rows;
  if (first >= N) return;
  const int count = (int)min((long)rows, N - first);
  __global const float* restrict in = x + first * width;
  __global float* restrict out_mean = mean + (long)chunk * C + channel;
  __global float* restrict out_m2 = m2 + (long)chunk * C + channel;
  for (int c = 0; c < width; ++c) out_mean[c] = in[c], out_m2[c] = 0.0f;
  int row = 0;
  for (; row + ROWS <= count; row += ROWS) {
    __global const float* restrict p = in + (long)row * width;
    const float n = (float)row, share = row == 0 ? 1.0f : ROWS / (n + ROWS);
    int c = 0;
    for (; c + 16 <= width; c += 16) {
      float16 a = vload16(0, out_mean + c), b = vload16(0, out_m2 + c);
      const float16 r0 = vload16(0, p + c), r1 = vload16(0, p + width + c), r2 = vload16(0, p + 2 * width + c),
                    r3 = vload16(0, p + 3 * width + c), r4 = vload16(0, p + 4 * width + c), r5 = vload16(0, p + 5 * width + c),
                    r6 = vload16(0, p + 6 * width + c), r7 = vload16(0, p + 7 * width + c);
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
    __global const float* restrict p = in + (long)row * width;
    for (int c = 0; c < width; ++c) {
      float a = out_mean[c], b = out_m2[c];
      MERGE_ONE(float, a, b, p[c], (float)row)
      out_mean[c] = a;
      out_m2[c] = b;
    }
  }
}

// A work-item per channel of the source (direction 0) and chunk (direction 1).
__kernel void groupnorm_chunks_gpu(__global const float* restrict x, __global float* restrict mean, __global float* restrict m2, int N,
                                   int width, int channel, int C, int rows) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  const long first = (long)chunk * rows;
  if (c >= width || first >= N) return;
  const int count = (int)min((long)rows, N - first);
  __global const float* restrict p = x + first * width + c;
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

// Over the chunks: a work-item per channel. N >= 1.
__kernel void groupnorm_channels(__global const float* restrict mean, __global const float* restrict m2,
                                 __global float* restrict channel_mean, __global float* restrict channel_m2, int N, int C, int rows,
                                 int chunks) {
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

// Over a group's channels, once more for each of them: a work-item per channel. N = 0: mean and variance count as 0.
__kernel void groupnorm_scale(__global const float* restrict channel_mean, __global const float* restrict channel_m2,
                              __global const float* restrict gamma, __global const float* restrict beta, __global float* restrict scale,
                              __global float* restrict shift, int N, int C, int G, float eps) {
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
}
