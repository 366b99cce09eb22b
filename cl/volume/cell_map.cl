// Neighbours of points, for submanifold convolutions over the cells of a sparse grid in which several points may share
// a cell. The one with the highest index represents the cell. Cells are found by bisection in the list of points in
// Morton order.
// ```
// argument    type  shape   what
// cells       i32   [P,3]   each point's cell, below 2^depth
// codes       u64   [P]     places along Morton's curve, ascending
// points      u32   [P]     the point at each place; points at equal places ascend
// standing    i32   [P]     written: the point that represents the cell of each
// map         i32   [P,27]  written: the point at offset (a-1, b-1, c-1) for tap (3a + b) 3 + c, where a goes along x;
//                           -1 if there is none. The middle tap is the point itself, the others are the points that
//                           represent their cells
// depth       int           bits of an axis
// all         int           0: points that do not represent their cell have only the first 13 taps and the middle
// work-items  one per point, in all kernels
// ```
#include "space_curve.clh"

// The point that represents a cell, -1 if the cell is empty.
static inline int standing_at(int3 c, int depth, global const ulong* codes, global const uint* points, int P) {
  const int edge = 1 << depth;
  if (c.x < 0 || c.y < 0 || c.z < 0 || c.x >= edge || c.y >= edge || c.z >= edge) return -1;
  const ulong code = interleave(c, depth);
  int low = 0, high = P;  // the last place that is not beyond the cell's is before `high`
  while (low < high) {
    const int middle = (low + high) / 2;
    if (codes[middle] <= code)
      low = middle + 1;
    else
      high = middle;
  }
  return low > 0 && codes[low - 1] == code ? (int)points[low - 1] : -1;
}

static inline int3 offset_of(int tap) { return (int3)(tap / 9 - 1, tap / 3 % 3 - 1, tap % 3 - 1); }

kernel void cell_map_forward(global const int* restrict cells, global const ulong* restrict codes,
                             global const uint* restrict points, global int* restrict standing,
                             global int* restrict map, int P, int depth, int all) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const int3 c = vload3(p, cells);
  const int own = standing_at(c, depth, codes, points, P), taps = all || own == p ? 27 : 14;
  standing[p] = own;
  for (int tap = 0; tap < 27; ++tap) {
    int at = -1;
    if (tap == 13)
      at = p;
    else if (tap < taps)
      at = standing_at(c + offset_of(tap), depth, codes, points, P);
    map[(long)p * 27 + tap] = at;
  }
}

// The reverse map, for a convolution's derivative by its inputs: the gradient of what reads a point through tap t
// returns through tap 26 - t. It is read from 2 P rows: each point's own, then for each point that represents a cell
// the sum of the rows of the points in it.
// ```
// argument    type  shape   what
// standing    i32   [P]     as the forward left it
// map         i32   [P,27]  written: rows of the 2 P, -1 if there is none
// ```
kernel void cell_map_backward(global const int* restrict cells, global const ulong* restrict codes,
                              global const uint* restrict points, global const int* restrict standing,
                              global int* restrict map, int P, int depth, int all) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const int3 c = vload3(p, cells);
  for (int tap = 0; tap < 27; ++tap) {
    int at = -1;
    if (tap == 13) {
      at = p;
    } else if (standing[p] == p) {
      at = standing_at(c + offset_of(tap), depth, codes, points, P);
      // Either all of a cell's points read through the forward's tap 26 - tap, or only its representative.
      if (at >= 0 && (all || 26 - tap < 13)) at += P;
    }
    map[(long)p * 27 + tap] = at;
  }
}

// ```
// argument    type  shape  what
// x, sums     f32   [n]    the two halves
// out         f32   [2 n]  written
// work-items  one per number of a half
// ```
kernel void cell_map_halves(global const float* restrict x, global const float* restrict sums,
                            global float* restrict out, int n) {
  const int i = get_global_id(0);
  if (i >= n) return;
  out[i] = x[i];
  out[(size_t)n + i] = sums[i];
}
