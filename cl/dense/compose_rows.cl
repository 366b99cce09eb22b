// Writes composed rows to memory: for a GEMM whose map reads every row many times, and for sums over the rows of a
// layer's input.
//
// "Composed" means the same in all dense kernels (gemm, conv3d, Winograd). Row m in [0, M) of A has, for each of T
// taps, the channels of one source row: row map[row0 + m, t] or, without a map, row row0 + m.
//   1. x0's c0 channels, then x1's c1;
//   2. with scale and shift, v * scale[c] + shift[c];
//   3. with silu, v / (1 + exp(-v)).
// A source row that is absent (outside [0, src_rows)) is zero after all that.
// ```
// argument    type  shape          what
// x0          f32   [src_rows,c0]  first source
// x1          f32   [src_rows,c1]  second source; null: none, c1 = 0
// scale       f32   [c0+c1]        per channel; null: neither scale nor shift
// shift       f32   [c0+c1]        per channel
// silu_a      int                  whether SiLU is applied
// map         i32   [..,T]         source rows; null: row row0 + m itself, T = 1
// out         f32   [M,T,c0+c1]    written
// work-items  one per 16 channels of each source, tap and row
// ```
#include "common.clh"
#include "many_registers.clh"
#include "vector16.clh"

kernel MORE_REGISTERS void compose_rows(global const float* x0, int c0, global const float* x1, int c1,
                                        global const float* scale, global const float* shift, int silu_a,
                                        global const int* map, int T, int src_rows, int row0, int M,
                                        global float* out) {
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
