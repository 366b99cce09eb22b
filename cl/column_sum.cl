// Sums over the rows of x [R, C], a few at a time: out [ceil(R / ROWS), C] holds the sums of ROWS rows each, taken in order, and is the
// next step's x until one row is left. So no sum has more than ROWS terms, and all have a fixed order.
// add (with one row left): out is added to.
#include "common.clh"

#ifndef ROWS
#define ROWS 64
#endif

// A work-item per (column, ROWS rows).
__kernel void column_sum(__global const float* x, __global float* out, int R, int C, int add) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  if (c >= C) return;
  float sum = 0.0f;
  for (int r = chunk * ROWS; r < min(R, (chunk + 1) * ROWS); ++r) sum += x[(size_t)r * C + c];
  const size_t at = (size_t)chunk * C + c;
  out[at] = add ? out[at] + sum : sum;
}
