// Transposes a matrix: converts between channels first and channels last.
// ```
// argument     type  shape  what
// x            f32   [A,B]  matrix
// out          f32   [B,A]  written: x transposed; with `add` added to
// define TILE               16, or 8 if groups are small
// work-items   groups of TILE TILE, one per tile of x: (columns, rows)
// ```
// A tile goes through local memory, so that both sides are accessed along their rows.
#include "common.clh"

#ifndef TILE
#define TILE 16
#endif

kernel __attribute__((reqd_work_group_size(TILE * TILE, 1, 1))) void transpose(global const float* restrict x,
                                                                               global float* restrict out, int A, int B,
                                                                               int add) {
  local float tile[TILE][TILE + 1];
  const int i = get_local_id(0) % TILE, j = get_local_id(0) / TILE;
  const int b0 = GROUP_ID(0) * TILE, a0 = GROUP_ID(1) * TILE;
  if (a0 + j < A && b0 + i < B) tile[j][i] = x[(size_t)(a0 + j) * B + b0 + i];
  barrier(CLK_LOCAL_MEM_FENCE);
  if (b0 + j >= B || a0 + i >= A) return;
  const size_t to = (size_t)(b0 + j) * A + a0 + i;
  out[to] = add ? out[to] + tile[i][j] : tile[i][j];
}
