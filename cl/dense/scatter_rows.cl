// The reverse of sampling: weighted rows are added to the rows that they were sampled from,
//   out[index[e]] += scale * weight[e] * d[first + e / per_row], for each row of out in the order of the entries e.
// A plan holds the entries in the order of the rows that they go to. Sums are made of at most WINDOW sorted entries,
// then of those sums: so a row may have any number of entries, and the work is shared out evenly.
// ```
// argument       type  shape          what
// index          i32   [E]            the row of out that an entry goes to; negative: skipped
// weight         f32   [E]            0: skipped (scatter_windows takes it sorted)
// keys           u32   [E]            the plan: each entry's row, `rows` for skipped ones; sorted, they come last
// from           u32   [E]            the plan: the index of each sorted entry
// sorted_weight  f32   [E]            the plan: their weights
// starts         u32   [rows+1]       the plan: where each row's run of sorted entries begins
// d              f32   [D,C]          added rows: entry e has row first + e / per_row
// edges          f32   [windows,2,C]  for each window, sum 0 of the run that began in an earlier window, and sum 1
//                                     of the run that begins here and continues in the next
// out            f32   [rows,C]       added to
// define LANES   16                   channels of a work-item, 4 or 16
// define WINDOW  64                   sorted entries of a window
// ```
#ifndef LANES
#define LANES 16
#endif
#ifndef WINDOW
#define WINDOW 64
#endif

// Makes the keys that the plan is sorted by. One work-item per entry.
kernel void scatter_keys(global const int* index, global const float* weight, global uint* keys, uint E, uint rows) {
  const uint e = get_global_id(0);
  if (e < E) keys[e] = index[e] < 0 || weight[e] == 0.0f ? rows : (uint)index[e];
}

// Finishes a plan from its sorted keys and from: writes sorted_weight and starts. One work-item per entry and one more.
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

// The channels of a work-item: LANES of them from c on, or one (the rest of C, if it is no multiple of LANES); none if
// c is C.
typedef struct {
  int c, one;
} Channels;

static inline Channels channels_of(int item, int C) {
  const int whole = C / LANES;
  const Channels out = {item < whole ? item * LANES : min(item - whole + whole * LANES, C), item >= whole};
  return out;
}

// The sum over the sorted entries i .. stop - 1.
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

// Adds a work-item's channels to a row.
static inline void add_to(FLOATS sum, global float* to, Channels at) {
  if (at.one)
    to[at.c] += sum.s0;
  else
    STORE(LOAD(to + at.c) + sum, to + at.c);
}

// Runs within the window are added to out; the others go to edges. Work-items (channels, window).
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

// Adds the rows whose runs crossed a window's end. Work-items (channels, row).
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
