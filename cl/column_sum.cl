// Sums over the rows of x [R, C], a few at a time: out [ceil(R / ROWS), C] holds the sums of ROWS rows each, taken in order, and is the
// next step's x until one row is left. So no sum has more than ROWS terms, and all have a fixed order, the same in both flavours.
// add (with one row left): out is added to.
#include "common.clh"
#include "vector16.clh"

#ifndef ROWS
#define ROWS 64
#endif

// gpu flavour: a work-item per (column, ROWS rows).
kernel void column_sum(global const float* x, global float* out, int R, int C, int add) {
  const int c = get_global_id(0), chunk = get_global_id(1);
  if (c >= C) return;
  float sum = 0.0f;
  for (int r = chunk * ROWS; r < min(R, (chunk + 1) * ROWS); ++r) sum += x[(size_t)r * C + c];
  const size_t at = (size_t)chunk * C + c;
  out[at] = add ? out[at] + sum : sum;
}

// cpu flavour: work-groups of one work-item, per ROWS rows.
kernel void column_sum_cpu(global const float* x, global float* out, int R, int C, int add) {
  const int chunk = get_group_id(0), until = min(R, (chunk + 1) * ROWS);
  for (int c = 0; c < C; c += 16) {
    const int width = min(16, C - c);
    float16 sum = 0.0f;
    for (int r = chunk * ROWS; r < until; ++r) sum += load_part(x + (size_t)r * C + c, width);
    global float* to = out + (size_t)chunk * C + c;
    store_part(add ? load_part(to, width) + sum : sum, width, to);
  }
}
