// Sums over the rows of a tensor, ROWS rows at a time: the result is the next step's input until one row is left. So no
// sum has more than ROWS terms, and the order of additions is fixed and equal in both flavours.
// ```
// argument     type  shape             what
// x            f32   [R,C]             rows
// out          f32   [ceil(R/ROWS),C]  written: the sums of ROWS rows each, taken in order
// add          int                     if not 0, the sums are added to out (for the last step)
// define ROWS  64                      rows of a sum
// ```
#include "common.clh"
#include "vector16.clh"

#ifndef ROWS
#define ROWS 64
#endif

// gpu flavour: work-items (column, block of ROWS rows).
kernel void column_sum(global const float* x, global float* out, int R, int C, int add) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  if (c >= C) return;
  float sum = 0.0f;
  for (int r = chunk * ROWS; r < min(R, (chunk + 1) * ROWS); ++r) sum += x[(size_t)r * C + c];
  const size_t at = (size_t)chunk * C + c;
  out[at] = add ? out[at] + sum : sum;
}

// cpu flavour: work-groups of one work-item, one per block of ROWS rows.
kernel void column_sum_cpu(global const float* x, global float* out, int R, int C, int add) {
  const int chunk = GROUP_ID(0), until = min(R, (chunk + 1) * ROWS);
  for (int c = 0; c < C; c += 16) {
    const int width = min(16, C - c);
    float16 sum = 0.0f;
    for (int r = chunk * ROWS; r < until; ++r) sum += load_part(x + (size_t)r * C + c, width);
    global float* to = out + (size_t)chunk * C + c;
    store_part(add ? load_part(to, width) + sum : sum, width, to);
  }
}
