// A GEMM's rows, composed in memory: for a map that reads every row many times, and for sums over rows of what a layer was given.
#include "common.clh"
#include "vector16.clh"

// Row m in [0, M) of `out` [M, T (c0 + c1)] is, for each of T taps, the source row map[row0 + m, t] (row0 + m where map is null): x0's c0
// channels, then x1's c1; with scale v * scale[c] + shift[c]; with silu v / (1 + exp(-v)). A source row outside [0, src_rows) is zero.
//   x0 [src_rows, c0]; x1 [src_rows, c1] or null; scale, shift [c0 + c1] or null; map [.., T] or null
// One work-item per 16 channels of each source, tap and row.
kernel void compose_rows(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                         global const float* shift, int silu_a, global const int* map, int T, int src_rows, int row0,
                         int M, global float* out) {
  const int chunks0 = DIV_UP(c0, 16), chunks = chunks0 + DIV_UP(c1, 16), C = c0 + c1;
  const size_t i = get_global_id(0) / chunks;
  const int chunk = get_global_id(0) % chunks;
  if (i >= (size_t)M * T) return;
  const int r = map ? map[(size_t)row0 * T + i] : row0 + (int)i;
  const int second = chunk >= chunks0;
  const int c = (second ? chunk - chunks0 : chunk) * 16, count = second ? c1 : c0, width = min(16, count - c);
  const int channel = second ? c0 + c : c;
  float16 v = 0.0f;
  if (r >= 0 && r < src_rows) {
    v = load_part((second ? x1 : x0) + (size_t)r * count + c, width);
    if (scale) v = FMA(v, load_part(scale + channel, width), load_part(shift + channel, width));
    if (silu_a) v = v / (1.0f + exp(-v));
  }
  store_part(v, width, out + i * C + channel);
}
