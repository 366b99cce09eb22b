// 3x3x3 convolution, stride 1, zero padding 1, of a channels-last volume [X,Y,Z,C], gpu flavour: a GEMM whose rows are
// gathered by their coordinates. The inputs are composed (compose_rows.cl); the padding is zero after that.
struct Rows {
  int X, Y, Z;
};
struct Source {
  int row;
  uint taps;  // a bit for each that is inside the volume
};
static inline struct Source source_of(const struct Rows* r, int m) {
  const int z = m % r->Z, xy = m / r->Z, y = xy % r->Y, x = xy / r->Y;
  const uint along_z = (z > 0 ? 1 : 0) | 2 | (z + 1 < r->Z ? 4 : 0);
  const uint plane = (y > 0 ? along_z : 0) | along_z << 3 | (y + 1 < r->Y ? along_z << 6 : 0);
  const struct Source out = {m, (x > 0 ? plane : 0) | plane << 9 | (x + 1 < r->X ? plane << 18 : 0)};
  return out;
}
static inline int step_of(const struct Rows* r, int t) {
  return ((t / 9 - 1) * r->Y + t / 3 % 3 - 1) * r->Z + t % 3 - 1;
}
static inline int source_row(const struct Rows* r, const struct Source* of, int step, int t) {
  return of->taps >> t & 1 ? of->row + step : -1;
}
#include "conv3d.clh"
#include "tile_gpu.clh"

// ```
// argument    type  shape     what
// w           f32   [N,C,27]  weights as PyTorch has them; see conv3d.clh for mirrored
// b           f32   [27,C,N]  written: by tap (dx, dy, dz), input channel, output channel
// work-items  one per element
// ```
kernel void conv3d_pack_weights(global const float* w, int mirrored, int C, int N, global float* b) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)27 * C * N) return;
  b[i] = weight_of(w, mirrored, N, C, i % N, i / N % C, i / ((size_t)C * N));
}

// ```
// argument      type  shape         what
// x0            f32   [X,Y,Z,c0]    first source
// x1            f32   [X,Y,Z,c1]    second source; null: none, c1 = 0
// scale, shift  f32   [c0+c1]       null: neither
// silu_a        int                 whether SiLU is applied
// b             f32   [27,c0+c1,N]  weights, from conv3d_pack_weights
// bias          f32   [N]           null: none
// residual      f32   [X,Y,Z,N]     null: none; may be out
// out           f32   [X,Y,Z,N]     written
// work-items    groups of SIDE SIDE: (tile of channels, tile of voxels), see tile_gpu.clh
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void conv3d_forward_gpu(
    global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
    global const float* shift, int silu_a, int X, int Y, int Z, global const float* b, int N, global const float* bias,
    global const float* residual, global float* out) {
  local float4 work[WORK];
  const struct Rows rows = {X, Y, Z};
  tile_gpu(work, x0, c0, x1, c1, scale, shift, silu_a, &rows, 27, X * Y * Z, b, X * Y * Z, N, bias, 0, residual, out, 0,
           ALL_TERMS);
}

// The weight gradient's sum over one chunk of `rows` voxels, as a product with BM rows (tap, c) and BN columns a tile.
// ```
// argument      type  shape            what
// x0 .. silu_a                         the convolution's inputs, as in conv3d_forward_gpu
// dy            f32   [X,Y,Z,N]        gradient of out
// rows          int                    voxels of a chunk
// partial       f32   [chunks,27,C,N]  written: the sum over the chunk's voxels p of in[p + tap - 1, c] dy[p, n]
// work-items    groups of SIDE SIDE: (tile of columns, tile of rows, chunk)
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void
conv3d_backward_weights_gpu(global const float* x0, int c0, global const float* x1, int c1, global const float* scale,
                            global const float* shift, int silu_a, int X, int Y, int Z, global const float* dy, int N,
                            int rows, global float* partial) {
  local float4 work[WORK];
  local float4* as = work;
  local float4* bs = work + BK * AS / 4;
  const struct Rows volume = {X, Y, Z};
  const int item = get_local_id(0), tx = item % SIDE, ty = item / SIDE, C = c0 + c1, K = 27 * C;
  const int n0 = GROUP_ID(0) * BN, k0 = GROUP_ID(1) * BM, chunk = GROUP_ID(2);
  const int until = min((chunk + 1) * rows, X * Y * Z);
  Tile tile;
  tile_gpu_clear(&tile);
  for (int first = chunk * rows; first < until; first += BK) {
    for (int at = item; at < BK * BM; at += SIDE * SIDE) {
      const int p = first + at / BM, k = k0 + at % BM;
      float v = 0.0f;
      if (p < until && k < K) {
        const int t = k / C, c = k - t * C;
        const struct Source source = source_of(&volume, p);
        const int row = source_row(&volume, &source, step_of(&volume, t), t);
        if (row >= 0) {
          v = c < c0 ? x0[(size_t)row * c0 + c] : x1[(size_t)row * c1 + (c - c0)];
          if (scale) v = FMA(v, scale[c], shift[c]);
          if (silu_a) v = silu(v);
        }
      }
      ((local float*)as)[at / BM * AS + at % BM] = v;
    }
    for (int at = item; at < BK * BN; at += SIDE * SIDE) {
      const int p = first + at / BN, n = n0 + at % BN;
      ((local float*)bs)[at] = p < until && n < N ? dy[(size_t)p * N + n] : 0.0f;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    tile_gpu_add(as, bs, &tile);
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  tile_gpu_write(work, &tile, k0, K, n0, N, 0, 0, 0, partial + (size_t)chunk * K * N);
}
