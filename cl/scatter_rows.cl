// The transposed of sampling: weighted rows added to the rows they were sampled from.
//   index [E] (i32: a row of out; negative: passed over)   weight [E] (0: passed over)   d [D, C]   out [rows, C]
//   out[index[e]] += scale * weight[e] * d[first + e / per_row], for each row of out in the order of e.
// A plan has the entries in order of the rows they go to: from [E] (u32, which entry), keys [E] (u32, its row),
// sorted_weight [E], and starts [rows + 1] (u32), where each row's run begins. Entries passed over come after the last run.
// Sums are made of WINDOW sorted entries at the most, then of those: rows may have any number of entries, and all share
// out evenly. Work-items (channel, ..): LANES channels each while there are as many, then one each.
#ifndef LANES
#define LANES 16  // 4 or 16
#endif
#ifndef WINDOW
#define WINDOW 64
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

// The channels of a work-item: one from c on, or LANES; none where c is C.
typedef struct {
  int c, one;
} Channels;

static inline Channels channels_of(int item, int C) {
  const int whole = C / LANES;
  const Channels out = {item < whole ? item * LANES : min(item - whole + whole * LANES, C), item >= whole};
  return out;
}

// The sum over sorted entries i .. stop - 1.
static inline FLOATS sum_of(global const float* d, global const uint* from, global const float* weight, uint i,
                            uint stop, uint first, uint per_row, int C, Channels at) {
  FLOATS sum = (FLOATS)(0.0f);
  if (at.one) {
    float alone = 0.0f;
    for (; i < stop; ++i) alone += weight[i] * d[(size_t)(first + from[i] / per_row) * C + at.c];
    sum.s0 = alone;
  } else {
    for (; i < stop; ++i) sum += weight[i] * LOAD(d + (size_t)(first + from[i] / per_row) * C + at.c);
  }
  return sum;
}

static inline void add_to(FLOATS sum, global float* to, Channels at) {
  if (at.one)
    to[at.c] += sum.s0;
  else
    STORE(LOAD(to + at.c) + sum, to + at.c);
}

// Work-items (channel, window). Runs within the window are added to out. Those that cross its ends go to
// edges [windows, 2, C]: 0 what began in an earlier window, 1 what begins here and goes on in the next.
kernel void scatter_windows(global const float* d, global const uint* from, global const uint* keys,
                            global const float* weight, global const uint* starts, global float* edges,
                            global float* out, uint E, uint rows, int C, uint first, uint per_row, float scale) {
  const uint begin = (uint)get_global_id(1) * WINDOW, end = min(begin + WINDOW, min(starts[rows], E));
  const Channels at = channels_of(get_global_id(0), C);
  if (at.c == C) return;
  for (uint i = begin; i < end;) {
    const uint row = keys[i], next = starts[row + 1], stop = min(next, end);
    const FLOATS sum = scale * sum_of(d, from, weight, i, stop, first, per_row, C, at);
    if (i == starts[row] && stop == next) {
      add_to(sum, out + (size_t)row * C, at);
    } else {
      global float* edge = edges + ((size_t)get_global_id(1) * 2 + (i == starts[row])) * C;
      if (at.one)
        edge[at.c] = sum.s0;
      else
        STORE(sum, edge + at.c);
    }
    i = stop;
  }
}

// Work-items (channel, row). The rows whose runs crossed a window's end.
kernel void scatter_edges(global const uint* starts, global const float* edges, global float* out, uint rows, int C) {
  const uint row = get_global_id(1);
  const Channels at = channels_of(get_global_id(0), C);
  if (row >= rows || at.c == C || starts[row] == starts[row + 1]) return;
  const uint begin = starts[row] / WINDOW, last = (starts[row + 1] - 1) / WINDOW;
  if (begin == last) return;
  if (at.one) {
    float sum = edges[((size_t)begin * 2 + 1) * C + at.c];
    for (uint w = begin + 1; w <= last; ++w) sum += edges[(size_t)w * 2 * C + at.c];
    out[(size_t)row * C + at.c] += sum;
  } else {
    FLOATS sum = LOAD(edges + ((size_t)begin * 2 + 1) * C + at.c);
    for (uint w = begin + 1; w <= last; ++w) sum += LOAD(edges + (size_t)w * 2 * C + at.c);
    add_to(sum, out + (size_t)row * C, at);
  }
}
