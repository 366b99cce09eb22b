// 3x3x3 convolution, stride 1, zero padding 1, of a channels-last volume [X, Y, Z, C], gpu flavour: a GEMM whose rows are gathered by
// their coordinates. Composition as in gemm_gpu.cl; the padding is zero after it.
//   x0 [X, Y, Z, c0]; x1 [X, Y, Z, c1] or null; scale, shift [c0 + c1] or null; b [27 (dx, dy, dz), c0 + c1, N]
//   bias [N] or null; residual, out [X, Y, Z, N]; residual may be null or out itself
struct Rows {
  int X, Y, Z;
};
static inline int source_row(const struct Rows* r, int m, int t) {
  const int z = m % r->Z + t % 3 - 1, y = m / r->Z % r->Y + t / 3 % 3 - 1, x = m / (r->Z * r->Y) + t / 9 - 1;
  const int inside = x >= 0 && x < r->X && y >= 0 && y < r->Y && z >= 0 && z < r->Z;
  return inside ? (x * r->Y + y) * r->Z + z : -1;
}
#include "conv3d.clh"
#include "tile_gpu.clh"

// b of w (see conv3d.clh). A work-item per element.
__kernel void conv3d_pack_weights(__global const float* w, int mirrored, int C, int N, __global float* b) {
  const size_t i = get_global_id(0);
  if (i >= (size_t)27 * C * N) return;
  b[i] = weight_of(w, mirrored, N, C, i % N, i / N % C, i / ((size_t)C * N));
}

__kernel __attribute__((reqd_work_group_size(SIDE * SIDE, 1, 1))) void conv3d_tile_gpu(
    __global const float* x0, int c0, __global const float* x1, int c1, __global const float* scale,
    __global const float* shift, int silu_a, int X, int Y, int Z, __global const float* b, int N,
    __global const float* bias, __global const float* residual, __global float* out) {
  __local float as[BK * AS], bs[BK * BN];
  const struct Rows rows = {X, Y, Z};
  tile_gpu(as, bs, x0, c0, x1, c1, scale, shift, silu_a, &rows, 27, X * Y * Z, b, X * Y * Z, N, bias, 0, residual, out,
           0);
}
