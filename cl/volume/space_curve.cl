// Orders points along space-filling curves: the cells of a grid in which they lie, the cells' places along a curve, and
// runs of a fixed number of points along it.
// ```
// argument    type  shape        what
// points      f32   [P,3]        places
// least       f32   [blocks,3]   written: the smallest coordinate of `block` points along each axis
// block       int                points of a sum
// work-items  one per block
// ```
#include "space_curve.clh"

kernel void space_curve_least(global const float* restrict points, global float* restrict least, int P, int block) {
  const int b = get_global_id(0);
  if (b * block >= P) return;
  const int end = min(P, (b + 1) * block);
  float3 low = vload3(b * block, points);
  for (int p = b * block + 1; p < end; ++p) low = min(low, vload3(p, points));
  vstore3(low, b, least);
}

// Cells from the smallest coordinate of each axis on.
// ```
// argument    type  shape     what
// least       f32   [1,3]     of all points
// cells       i32   [P,3]     written: trunc((point - least) / cell), at most 2^17 - 1
// most        i32   [blocks]  written: the largest of a block's cells
// cell        float           a cell's edge
// work-items  one per block
// ```
kernel void space_curve_cells(global const float* restrict points, global const float* restrict least,
                              global int* restrict cells, global int* restrict most, int P, int block, float cell) {
  const int b = get_global_id(0);
  if (b * block >= P) return;
  const int end = min(P, (b + 1) * block);
  const float3 low = vload3(0, least);
  int largest = 0;
  for (int p = b * block; p < end; ++p) {
    const float3 at = fmin((vload3(p, points) - low) / cell, (float3)(131071.0f));
    const int3 c = (int3)((int)at.x, (int)at.y, (int)at.z);
    vstore3(c, p, cells);
    largest = max(largest, max(c.x, max(c.y, c.z)));
  }
  most[b] = largest;
}

kernel void space_curve_most(global const int* restrict most, global int* restrict out, int n) {
  if (get_global_id(0) > 0) return;
  int largest = 0;
  for (int i = 0; i < n; ++i) largest = max(largest, most[i]);
  out[0] = largest;
}

// Skilling's Hilbert curve: from the top bit down, axis by axis, a set bit turns the first axis's lower bits over, and
// a clear one swaps them with that axis's; the interleaved bits are then a Gray code.
static inline ulong hilbert(int3 c, int depth) {
  int a[3] = {c.x, c.y, c.z};
  for (int bit = depth - 1; bit >= 0; --bit) {
    const int low = (1 << bit) - 1;
    for (int d = 0; d < 3; ++d) {
      if (a[d] >> bit & 1) {
        a[0] ^= low;
      } else {
        const int swapped = (a[0] ^ a[d]) & low;
        a[0] ^= swapped;
        a[d] ^= swapped;
      }
    }
  }
  ulong code = interleave((int3)(a[0], a[1], a[2]), depth);
  for (int shift = 1; shift < 64; shift *= 2) code ^= code >> shift;
  return code;
}

// ```
// argument     type  shape  what
// cells        i32   [P,3]  each below 2^depth
// codes        u64   [P]    written: the cell's place along the curve
// hilbert_one  int          1: the Hilbert curve, 0: Morton's order
// exchanged    int          1: x and y change places first
// depth        int          bits of an axis, at most 16
// work-items   one per point
// ```
kernel void space_curve_codes(global const int* restrict cells, global ulong* restrict codes, int P, int hilbert_one,
                              int exchanged, int depth) {
  const int p = get_global_id(0);
  if (p >= P) return;
  int3 c = vload3(p, cells);
  if (exchanged) c = c.yxz;
  codes[p] = hilbert_one ? hilbert(c, depth) : interleave(c, depth);
}

// Runs of `size` points, one after the other along the curve. A last run that is not full is filled with the same
// columns of the run before it.
// ```
// argument    type  shape  what
// order       u32   [P]    the points along the curve
// slots       i32   [S]    written: the point at each place of the runs, S a multiple of `size` (or P, if P <= size)
// places      i32   [P]    written: the place of each point itself in the runs
// filled      i32   [S-P]  written: the points in the slots after the first P
// work-items  one per slot
// ```
kernel void space_curve_runs(global const uint* restrict order, global int* restrict slots, global int* restrict places,
                             global int* restrict filled, int P, int S, int size) {
  const int s = get_global_id(0);
  if (s >= S) return;
  const int at = s < P ? s : s - size;
  slots[s] = (int)order[at];
  if (s < P)
    places[order[s]] = s;
  else
    filled[s - P] = (int)order[at];
}
