// Which Gaussians each tile of a part of the picture sees, near to far.
//   order [V]: Gaussians by depth. rects [V,2]: x0 | x1 << 16 and y0 | y1 << 16, the tiles that each touches. An
//   intersection is a pair of a tile (row-major, tiles_x in a row) and a Gaussian, N of them in all.
//   offsets [V+1], where given: exclusive scan of the tiles that each touches, in the Gaussians' own order; slots [N]
//   then gets, for each sorted intersection, its place in that order: offsets[v] + its number among v's tiles.
// cpu: a counting sort by tile in one pass. Blocks of consecutive Gaussians, one per work-item, count and then place
// their intersections by themselves. gpu: intersections are written out and sorted by radix_sort.
static inline uint tiles_of(uint x, uint y) { return ((x >> 16) - (x & 0xffff)) * ((y >> 16) - (y & 0xffff)); }

typedef struct {
  uint first, width, height;  // tile, and how many in a row, and rows
} Span;

static inline Span span_of(uint2 rect, int tiles_x) {
  const uint x = rect.x & 0xffff, y = rect.y & 0xffff;
  const Span out = {y * tiles_x + x, (rect.x >> 16) - x, (rect.y >> 16) - y};
  return out;
}

// From one tile of a span to the next, x of `width` in its row: one loop over all of them is left, and mispredicted, once.
static inline void next_tile(uint* tile, uint* x, uint width, int tiles_x) {
  const int wrap = *x + 1 == width;
  *tile += wrap ? tiles_x - width + 1 : 1;
  *x = wrap ? 0 : *x + 1;
}

// counts [V]: the tiles that each touches; in order of depth where `order` is given.
kernel void tile_bin_counts(global const uint* rects, global const uint* order, global uint* counts, int V) {
  const int i = get_global_id(0);
  if (i >= V) return;
  const uint2 rect = vload2(order ? order[i] : i, rects);
  counts[i] = tiles_of(rect.x, rect.y);
}

// ordered [V,2]: rects in order of depth, as counting and placing read them.
kernel void tile_bin_order(global const uint* rects, global const uint* order, global uint* ordered, int V) {
  const int i = get_global_id(0);
  if (i < V) vstore2(vload2(order[i], rects), i, ordered);
}

// histogram [blocks, tiles]: each block's intersections with each tile.
kernel void tile_bin_count(global const uint* ordered, global uint* histogram, int V, int block,
                           int blocks, int tiles_x, int tiles) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  global uint* count = histogram + (size_t)b * tiles;
  for (int t = 0; t < tiles; ++t) count[t] = 0;
  const int end = min(V, (b + 1) * block);
  for (int i = b * block; i < end; ++i) {
    const Span s = span_of(vload2(i, ordered), tiles_x);
    if (s.width <= 2 && s.height <= 2) {  // most: without a branch for each tile
      const uint right = s.width - 1, below = s.height - 1;
      global uint* at = count + s.first;
      ++at[0];
      at[right] += right;
      at += below * tiles_x;
      at[0] += below;
      at[right] += right & below;
    } else {
      for (uint t = s.first, x = 0, left = s.width * s.height; left > 0; --left) {
        ++count[t];
        next_tile(&t, &x, s.width, tiles_x);
      }
    }
  }
}

// totals [tiles]: sums over the blocks.
kernel void tile_bin_totals(global const uint* histogram, global uint* totals, int blocks, int tiles) {
  const int t = get_global_id(0);
  if (t >= tiles) return;
  uint sum = 0;
  for (int b = 0; b < blocks; ++b) sum += histogram[(size_t)b * tiles + t];
  totals[t] = sum;
}

// Counts become places: a tile's run begins at starts[t] and holds the blocks' parts in order.
kernel void tile_bin_place(global uint* histogram, global const uint* starts, int blocks, int tiles) {
  const int t = get_global_id(0);
  if (t >= tiles) return;
  uint at = starts[t];
  for (int b = 0; b < blocks; ++b) {
    const uint n = histogram[(size_t)b * tiles + t];
    histogram[(size_t)b * tiles + t] = at;
    at += n;
  }
}

// gaussians [N + blocks]: what comes after N is scratch.
kernel void tile_bin_scatter(global const uint* ordered, global const uint* order, global uint* histogram,
                             global const uint* offsets, global uint* gaussians, global uint* slots, int V, int block,
                             int blocks, int tiles_x, int tiles, uint N) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  global uint* place = histogram + (size_t)b * tiles;
  const uint nowhere = N + b;
  const int end = min(V, (b + 1) * block);
  for (int i = b * block; i < end; ++i) {
    const uint id = order[i];
    const Span s = span_of(vload2(i, ordered), tiles_x);
    if (!offsets && s.width <= 2 && s.height <= 2) {
      const uint right = s.width - 1, below = s.height - 1;
      global uint* to = place + s.first;
      gaussians[to[0]++] = id;
      gaussians[right ? to[right] : nowhere] = id;
      to[right] += right;
      to += below * tiles_x;
      gaussians[below ? to[0] : nowhere] = id;
      to[0] += below;
      gaussians[right & below ? to[right] : nowhere] = id;
      to[right] += right & below;
      continue;
    }
    uint slot = offsets ? offsets[id] : 0;
    for (uint t = s.first, x = 0, left = s.width * s.height; left > 0; --left) {
      const uint at = place[t]++;
      gaussians[at] = id;
      if (offsets) slots[at] = slot++;
      next_tile(&t, &x, s.width, tiles_x);
    }
  }
}

// tiles [N], gaussians [N], slots [N]: in order of depth, so that a stable sort by tile leaves each tile near to far.
// emitted [V+1]: exclusive scan of the tiles that each touches, in order of depth.
kernel void tile_bin_emit(global const uint* rects, global const uint* order, global const uint* emitted,
                          global const uint* offsets, global uint* tiles, global uint* gaussians, global uint* slots,
                          int V, int tiles_x) {
  const int i = get_global_id(0);
  if (i >= V) return;
  uint at = emitted[i];
  const uint id = order[i];
  const uint2 rect = vload2(id, rects);
  uint slot = offsets ? offsets[id] : 0;
  for (uint y = rect.y & 0xffff; y < rect.y >> 16; ++y) {
    for (uint x = rect.x & 0xffff; x < rect.x >> 16; ++x) {
      tiles[at] = y * tiles_x + x;
      if (offsets) slots[at] = slot++;
      gaussians[at++] = id;
    }
  }
}

// starts [tiles + 1]: where each tile's run begins in the sorted intersections. One work-item per intersection and one more.
kernel void tile_bin_ranges(global const uint* tiles, global uint* starts, uint N, uint tile_count) {
  const uint i = get_global_id(0);
  if (i > N) return;
  const uint first = i == 0 ? 0 : tiles[i - 1] + 1, last = i == N ? tile_count : tiles[i];
  for (uint t = first; t <= last; ++t) starts[t] = i;
}

// What was sorted along as its place before the sort, looked up there: out [N] = values[from[i]].
kernel void tile_bin_pick(global const uint* from, global const uint* values, global uint* out, uint N) {
  const uint i = get_global_id(0);
  if (i < N) out[i] = values[from[i]];
}
