// The transposed of sampling: weighted rows added to the rows they were sampled from.
//   index [E] (i32: a row of out; negative: passed over)   weight [E] (0: passed over)   d [D, C]   out [rows, C]
//   out[index[e]] += scale * weight[e] * d[first + e / per_row], for each row of out in the order of e.
// A plan has the entries in order of the rows they go to: from [E] (u32, which entry), sorted_weight [E], and
// starts [rows + 1] (u32), where each row's run begins. Entries passed over come after the last run.
#ifndef LANES
#define LANES 16  // channels of a work-item: 4 or 16
#endif
#ifndef RUN
#define RUN 64  // entries are summed by so many, then the sums: a texel may have many thousands
#endif

// keys [E]: what the plan is sorted by.
kernel void scatter_keys(global const int* index, global const float* weight, global uint* keys, uint E, uint rows) {
  const uint e = get_global_id(0);
  if (e < E) keys[e] = index[e] < 0 || weight[e] == 0.0f ? rows : (uint)index[e];
}

// One work-item per entry and one more. keys [E]: sorted, as from is.
kernel void scatter_plan(global const uint* keys, global const uint* from, global const float* weight,
                         global float* sorted_weight, global uint* starts, uint E, uint rows) {
  const uint i = get_global_id(0);
  if (i > E) return;
  const uint begin = i == 0 ? 0 : keys[i - 1] + 1, last = i == E ? rows : keys[i];
  for (uint row = begin; row <= last; ++row) starts[row] = i;
  if (i < E) sorted_weight[i] = weight[from[i]];
}

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define FLOATS JOIN(float, LANES)
#define LOAD(p) JOIN(vload, LANES)(0, p)
#define STORE(x, p) JOIN(vstore, LANES)(x, 0, p)

// Work-items (LANES channels, row).
kernel void scatter_rows(global const float* d, global const uint* from, global const float* weight,
                         global const uint* starts, global float* out, int rows, int C, uint first, uint per_row,
                         float scale) {
  const int row = get_global_id(1), c0 = (int)get_global_id(0) * LANES;
  if (row >= rows || c0 >= C) return;
  const uint begin = starts[row], end = starts[row + 1];
  if (begin == end) return;
  global float* to = out + (size_t)row * C;
  if (c0 + LANES <= C) {
    FLOATS total = (FLOATS)(0.0f);
    for (uint run = begin; run < end; run += RUN) {
      const uint stop = min(end - run, (uint)RUN) + run;
      FLOATS sum = (FLOATS)(0.0f);
      for (uint i = run; i < stop; ++i) sum += weight[i] * LOAD(d + (size_t)(first + from[i] / per_row) * C + c0);
      total += sum;
    }
    STORE(LOAD(to + c0) + scale * total, to + c0);
    return;
  }
  for (int c = c0; c < C; ++c) {
    float total = 0.0f;
    for (uint run = begin; run < end; run += RUN) {
      const uint stop = min(end - run, (uint)RUN) + run;
      float sum = 0.0f;
      for (uint i = run; i < stop; ++i) sum += weight[i] * d[(size_t)(first + from[i] / per_row) * C + c];
      total += sum;
    }
    to[c] += scale * total;
  }
}
