// 3x3x3 convolution, stride 1, zero padding 1, of a channels-last volume [X,Y,Z,C], gpu flavour, by Winograd's F(4x4,
// 3x3) over x and y and directly along z: see conv3d_winograd.cl for the method, and for what tile t of the volume is.
// Inputs are transformed into memory; then a product for each of the 36 coefficients follows, whose rows are three
// neighbours along z side by side; its results are transformed back.
#define LANES 1
#include "winograd.clh"

// Rows of a coefficient's transformed inputs: Z + 2 for each tile, with the padding along z.
struct Rows {
  int Z;
};
struct Source {
  int row;
};
static inline struct Source source_of(const struct Rows* r, int m) {
  const struct Source out = {m / r->Z * (r->Z + 2) + m % r->Z};
  return out;
}
static inline int step_of(const struct Rows* r, int t) { return t; }
static inline int source_row(const struct Rows* r, const struct Source* of, int step, int t) { return of->row + step; }
#include "conv3d.clh"
#include "tile_gpu.clh"

// ```
// argument    type  shape      what
// w           f32   [N,C,27]   weights as PyTorch has them; see conv3d.clh for mirrored
// u           f32   [36,3,C,N] written: G g G^T; coefficient, dz, input channel, output channel
// work-items  one per (dz, input channel, output channel)
// ```
kernel void winograd_pack_weights_gpu(global const float* w, int mirrored, int C, int N, global float* u) {
  const size_t i = get_global_id(0), plane = (size_t)3 * C * N;
  if (i >= plane) return;
  const int n = i % N, c = i / N % C, dz = i / ((size_t)C * N);
  float half_way[18];  // dy, coefficient along x
#pragma unroll
  for (int dy = 0; dy < 3; ++dy)
    transform_weights(weight_of(w, mirrored, N, C, n, c, dy * 3 + dz),
                      weight_of(w, mirrored, N, C, n, c, 9 + dy * 3 + dz),
                      weight_of(w, mirrored, N, C, n, c, 18 + dy * 3 + dz), half_way + 6 * dy);
#pragma unroll
  for (int k = 0; k < 6; ++k) {
    float row[6];
    transform_weights(half_way[k], half_way[6 + k], half_way[12 + k], row);
#pragma unroll
    for (int j = 0; j < 6; ++j) u[(6 * k + j) * plane + i] = row[j];
  }
}

// ```
// argument      type  shape                 what
// x0            f32   [X,Y,Z,c0]            first source
// x1            f32   [X,Y,Z,c1]            second source; null: none, c1 = 0
// scale, shift  f32   [c0+c1]               composed as compose_rows.cl says; null: neither
// silu_a        int                         whether SiLU is applied; the padding is zero after all that
// tile0, tiles  int                         the first tile, and how many
// v             f32   [36,tiles,Z+2,c0+c1]  written: B^T d B
// work-items    one per (tile, z, channel)
// ```
kernel MORE_REGISTERS void winograd_forward_pack_gpu(global const float* x0, int c0, global const float* x1, int c1,
                                                     global const float* scale, global const float* shift, int silu_a,
                                                     int X, int Y, int Z, int tile0, int tiles, global float* v) {
  const int C = c0 + c1, TY = DIV_UP(Y, 4);
  const size_t i = get_global_id(0), plane = (size_t)tiles * (Z + 2) * C;
  if (i >= plane) return;
  const int c = i % C, row = i / C, z = row % (Z + 2) - 1, tile = tile0 + row / (Z + 2);
  const int x_first = 4 * (tile / TY) - 1, y_first = 4 * (tile % TY) - 1;
  const float a = scale ? scale[c] : 1.0f, b = scale ? shift[c] : 0.0f;
  global const float* from = c < c0 ? x0 + c : x1 + (c - c0);
  const int stride = c < c0 ? c0 : c1;
  float near[18], far[18];  // x = 0 .. 2 and 3 .. 5, y: Intel's compiler keeps an array of 36 in memory
#pragma unroll
  for (int k = 0; k < 6; ++k) {
    const int x = x_first + k, inside = x >= 0 && x < X && z >= 0 && z < Z;
    float line[6];
#pragma unroll
    for (int j = 0; j < 6; ++j) {
      const int y = y_first + j;
      line[j] = 0.0f;
      if (inside && y >= 0 && y < Y) {
        const float value = FMA(from[(size_t)((x * Y + y) * Z + z) * stride], a, b);
        line[j] = silu_a ? silu(value) : value;
      }
    }
    transform_in(line, k < 3 ? near + 6 * k : far + 6 * (k - 3), 1);
  }
#pragma unroll
  for (int k = 0; k < 6; ++k) {
    float column[6] = {near[k], near[6 + k], near[12 + k], far[k], far[6 + k], far[12 + k]};
    transform_in(column, column, 1);
#pragma unroll
    for (int j = 0; j < 6; ++j) v[(6 * j + k) * plane + i] = column[j];
  }
}

// ```
// argument    type  shape             what
// v           f32   [36,tiles,Z+2,C]  from winograd_forward_pack_gpu
// u           f32   [36,3,C,N]        from winograd_pack_weights_gpu
// m           f32   [36,tiles,Z,N]    written: their products, summed over dz and C
// work-items  groups of SIDE SIDE: (tile of channels, tile of rows, coefficient), see tile_gpu.clh
// ```
kernel MANY_REGISTERS FOUR_WAVES __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void
winograd_forward_tile_gpu(global const float* v, global const float* u, int tiles, int Z, int C, int N,
                          global float* m) {
  local float4 work[WORK];
  const struct Rows rows = {Z};
  const int k = GROUP_ID(2), M = tiles * Z, sources = tiles * (Z + 2);
  tile_gpu(work, v + (size_t)k * sources * C, C, 0, 0, 0, 0, 0, &rows, 3, sources, u + (size_t)k * 3 * C * N, M, N, 0,
           0, 0, m + (size_t)k * M * N, 0, ALL_TERMS);
}

// ```
// argument      type  shape           what
// m             f32   [36,tiles,Z,N]  from winograd_forward_tile_gpu
// tile0, tiles  int                   the first tile, and how many
// bias          f32   [N]             null: none
// residual      f32   [X,Y,Z,N]       null: none; may be out
// out           f32   [X,Y,Z,N]       written: the tiles of m, A^T m A + bias + residual
// work-items    one per (tile, z, channel)
// ```
kernel void winograd_forward_unpack_gpu(global const float* m, int X, int Y, int Z, int N, int tile0, int tiles,
                                        global const float* bias, global const float* residual, global float* out) {
  const size_t i = get_global_id(0), plane = (size_t)tiles * Z * N;
  if (i >= plane) return;
  const int n = i % N, row = i / N, z = row % Z, tile = tile0 + row / Z, TY = DIV_UP(Y, 4);
  const int x_first = 4 * (tile / TY), y_first = 4 * (tile % TY);
  const float added = bias ? bias[n] : 0.0f;
  float half_way[24];  // coefficient along x, y
#pragma unroll
  for (int k = 0; k < 6; ++k) {
    float line[6];
#pragma unroll
    for (int j = 0; j < 6; ++j) line[j] = m[(6 * k + j) * plane + i];
    transform_out(line, 1, half_way + 4 * k, 1);
  }
#pragma unroll
  for (int k = 0; k < 4; ++k) {
    float column[4];  // along x
    transform_out(half_way + k, 4, column, 1);
#pragma unroll
    for (int j = 0; j < 4; ++j) {
      const int x = x_first + j, y = y_first + k;
      if (x >= X || y >= Y) continue;
      const size_t at = (size_t)((x * Y + y) * Z + z) * N + n;
      out[at] = column[j] + added + (residual ? residual[at] : 0.0f);
    }
  }
}
