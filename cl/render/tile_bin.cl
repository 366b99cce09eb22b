// The Gaussians that each tile of a part of the picture sees, near to far. An intersection is a pair of a tile
// (row-major, tiles_x in a row) and a Gaussian that touches it; there are N of them.
// ```
// argument      type  shape  what
// order         u32   [V]    the Gaussians by depth, near to far
// rects         u32   [V,2]  x0 | x1 << 16 and y0 | y1 << 16: the rectangle of tiles that each one touches, ends
//                            exclusive
// masks         u64   [V]    the parts of its rectangle that each one touches (Span.mask); read if EXACT is defined
// offsets       u32   [V+1]  exclusive scan of the numbers of tiles that each one touches, in the Gaussians' own order;
//                            null: no slots are written
// slots         u32   [N]    written if offsets are given: the place of each sorted intersection in that order,
//                            offsets[v] + its number among v's tiles
// define EXACT               masks are given
// ```
// cpu: a counting sort by tile in one pass. Blocks of `block` consecutive Gaussians, one per work-item, count their
// intersections and then place them, independently of each other. gpu: intersections are written out (tile_bin_emit)
// and sorted by radix_sort.
#include "rasterize.clh"

// The tiles that a Gaussian touches: a rectangle of them, less those whose bit in a mask is 0. A bit stands for
// 2^shift_x x 2^shift_y tiles, so that 8 x 8 bits are enough for any rectangle.
typedef struct {
  uint first, width, height;  // tile, how many in a row, and rows
  uint shift_x, shift_y;
  ulong mask;
} Span;

#ifdef EXACT
#define MASK(i) masks[i]
#else  // no masks are given
#define MASK(i) (~(ulong)0)
#endif

// The smallest shift for which n tiles are at most 8 squares.
static inline uint shift_for(uint n) { return n <= 8 ? 0 : 29 - clz(n - 1); }

// The tiles of a rect; only its `first` depends on tiles_x.
static inline Span span_of(uint2 rect, ulong mask, int tiles_x) {
  const uint x = rect.x & 0xffff, y = rect.y & 0xffff, width = (rect.x >> 16) - x, height = (rect.y >> 16) - y;
  const Span out = {y * tiles_x + x, width, height, shift_for(width), shift_for(height), mask};
  return out;
}

// 1 where the Gaussian touches tile (x, y) of its rectangle, else 0.
static inline uint touches(Span s, uint x, uint y) {
  return (uint)(s.mask >> ((y >> s.shift_y) * 8 + (x >> s.shift_x))) & 1;
}

// A tile of a span. A single loop over all tiles of a span has one end for the processor to mispredict, instead of one
// for each row.
typedef struct {
  uint tile, x, y;
} Place;

static inline Place next_place(Place p, uint width, int tiles_x) {
  const uint wrap = p.x + 1 == width;
  const Place out = {p.tile + (wrap ? tiles_x - width + 1 : 1), wrap ? 0 : p.x + 1, p.y + wrap};
  return out;
}

// The number of tiles that the Gaussian touches.
static inline uint count_of(Span s) {
  if (s.mask == ~(ulong)0) return s.width * s.height;
  uint count = 0;
  for (uint y = 0; y < s.height; ++y)
    for (uint x = 0; x < s.width; ++x) count += touches(s, x, y);
  return count;
}

// The parts of its rectangle in which a Gaussian's alpha reaches 1/255, exact up to a margin for rounding.
// ```
// argument    type  shape   what
// records     f32   [V,12]  as project.cl writes them
// masks       u64   [V]     written
// x0, y0      int           the origin of the rectangles, a tile
// work-items  one per Gaussian
// ```
kernel void tile_bin_masks(global const float* records, global const uint* rects, global ulong* masks, int V, int x0,
                           int y0) {
  const int i = get_global_id(0);
  if (i >= V) return;
  const float4 place = vload4(0, records + (size_t)i * 12), form = vload4(1, records + (size_t)i * 12);
  const uint2 rect = vload2(i, rects);
  const Span s = span_of(rect, ~(ulong)0, 0);
  const float room = (form.x + LOG2_255) * 1.0001f + 1e-3f;
  const float wide = 16 << s.shift_x, high = 16 << s.shift_y;
  // The rectangle of pixel centres, a hundredth of a pixel larger on every side.
  const float left = place.x - (16.0f * (float)(x0 + (int)(rect.x & 0xffff)) + 0.49f);
  const float top = place.y - (16.0f * (float)(y0 + (int)(rect.y & 0xffff)) + 0.49f);

  ulong mask = 0;
  for (uint y = 0; y << s.shift_y < s.height; ++y) {
    for (uint x = 0; x << s.shift_x < s.width; ++x) {
      const float r = left - (float)x * wide, b = top - (float)y * high;
      const float fall = least_fall(form.y, form.z, form.w, r - wide + 0.98f, r, b - high + 0.98f, b);
      if (fall <= room) mask |= (ulong)1 << (8 * y + x);
    }
  }
  masks[i] = mask;
}

// counts [V]: written, the tiles that each Gaussian touches; in order of depth where `order` is given. One work-item
// per Gaussian.
kernel void tile_bin_counts(global const uint* rects, global const ulong* masks, global const uint* order,
                            global uint* counts, int V) {
  const int i = get_global_id(0);
  if (i >= V) return;
  const uint id = order ? order[i] : i;
  counts[i] = count_of(span_of(vload2(id, rects), MASK(id), 0));
}

// ordered [V,2], ordered_masks [V]: written, rects and (with EXACT) masks in order of depth, as counting and placing
// read them. One work-item per Gaussian.
kernel void tile_bin_order(global const uint* rects, global const ulong* masks, global const uint* order,
                           global uint* ordered, global ulong* ordered_masks, int V) {
  const int i = get_global_id(0);
  if (i >= V) return;
  vstore2(vload2(order[i], rects), i, ordered);
#ifdef EXACT
  ordered_masks[i] = masks[order[i]];
#endif
}

// histogram [blocks,tiles]: written, each block's intersections with each tile. One work-item per block.
kernel void tile_bin_count(global const uint* ordered, global const ulong* masks, global uint* histogram, int V,
                           int block, int blocks, int tiles_x, int tiles) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  global uint* count = histogram + (size_t)b * tiles;
  for (int t = 0; t < tiles; ++t) count[t] = 0;
  const int end = min(V, (b + 1) * block);
  for (int i = b * block; i < end; ++i) {
    const Span s = span_of(vload2(i, ordered), MASK(i), tiles_x);
    if (s.width <= 2 && s.height <= 2) {  // the most frequent case: no branch for each tile
      const uint right = s.width - 1, below = s.height - 1, mask = (uint)s.mask;
      global uint* at = count + s.first;
      at[0] += mask & 1;
      at[right] += right & mask >> 1;
      at += below * tiles_x;
      at[0] += below & mask >> 8;
      at[right] += right & below & mask >> 9;
      continue;
    }
    Place p = {s.first, 0, 0};
    for (uint left = s.width * s.height; left > 0; --left) {
      count[p.tile] += touches(s, p.x, p.y);
      p = next_place(p, s.width, tiles_x);
    }
  }
}

// totals [tiles]: written, the sums over the blocks. One work-item per tile.
kernel void tile_bin_totals(global const uint* histogram, global uint* totals, int blocks, int tiles) {
  const int t = get_global_id(0);
  if (t >= tiles) return;
  uint sum = 0;
  for (int b = 0; b < blocks; ++b) sum += histogram[(size_t)b * tiles + t];
  totals[t] = sum;
}

// Turns the counts in histogram into places: a tile's run begins at starts[t] and holds the blocks' parts in order. One
// work-item per tile.
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

// a if `which` is 1, b if it is 0, without a branch.
static inline uint either(uint a, uint b, uint which) { return b ^ ((a ^ b) & -which); }

// Places the intersections. One work-item per block.
// ```
// argument   type  shape           what
// ordered    u32   [V,2]           from tile_bin_order
// masks      u64   [V]             from tile_bin_order
// histogram  u32   [blocks,tiles]  places, from tile_bin_place; counted up
// gaussians  u32   [N+blocks]      written: the sorted intersections' Gaussians; after N there is scratch memory, for
//                                  Gaussians that touch no tile
// ```
kernel void tile_bin_scatter(global const uint* ordered, global const ulong* masks, global const uint* order,
                             global uint* histogram, global const uint* offsets, global uint* gaussians,
                             global uint* slots, int V, int block, int blocks, int tiles_x, int tiles, uint N) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  global uint* place = histogram + (size_t)b * tiles;
  const uint nowhere = N + b;
  const int end = min(V, (b + 1) * block);
  for (int i = b * block; i < end; ++i) {
    const uint id = order[i];
    const Span s = span_of(vload2(i, ordered), MASK(i), tiles_x);
    if (!offsets && s.width <= 2 && s.height <= 2) {
      const uint right = s.width - 1, below = s.height - 1, mask = (uint)s.mask;
      const uint one = mask & 1, two = right & mask >> 1, three = below & mask >> 8, four = right & below & mask >> 9;
      global uint* to = place + s.first;
      gaussians[either(to[0], nowhere, one)] = id;
      to[0] += one;
      gaussians[either(to[right], nowhere, two)] = id;
      to[right] += two;
      to += below * tiles_x;
      gaussians[either(to[0], nowhere, three)] = id;
      to[0] += three;
      gaussians[either(to[right], nowhere, four)] = id;
      to[right] += four;
      continue;
    }
    uint slot = offsets ? offsets[id] : 0;
    Place p = {s.first, 0, 0};
    for (uint left = s.width * s.height; left > 0; --left) {
      if (touches(s, p.x, p.y)) {
        const uint at = place[p.tile]++;
        gaussians[at] = id;
        if (offsets) slots[at] = slot++;
      }
      p = next_place(p, s.width, tiles_x);
    }
  }
}

// Writes the intersections in order of depth, so that a stable sort by tile leaves each tile's near to far.
// ```
// argument    type  shape  what
// emitted     u32   [V+1]  exclusive scan of the numbers of tiles in each one's rectangle, in order of depth
// tiles       u32   [N]    written; tiles that a mask leaves out are included as tile tile_count, after the last
// gaussians   u32   [N]    written
// slots       u32   [N]    written if offsets are given
// work-items  one per Gaussian
// ```
kernel void tile_bin_emit(global const uint* rects, global const ulong* masks, global const uint* order,
                          global const uint* emitted, global const uint* offsets, global uint* tiles,
                          global uint* gaussians, global uint* slots, int V, int tiles_x, int tile_count) {
  const int i = get_global_id(0);
  if (i >= V) return;
  uint at = emitted[i];
  const uint id = order[i];
  const Span s = span_of(vload2(id, rects), MASK(id), tiles_x);
  uint slot = offsets ? offsets[id] : 0;
  for (uint y = 0; y < s.height; ++y) {
    for (uint x = 0; x < s.width; ++x) {
      const uint hit = touches(s, x, y);
      tiles[at] = hit ? s.first + y * tiles_x + x : (uint)tile_count;
      if (offsets) slots[at] = slot;
      slot += hit;
      gaussians[at++] = id;
    }
  }
}

// starts [tiles + 1]: written, where each tile's run begins in the sorted intersections. One work-item per intersection
// and one more.
kernel void tile_bin_ranges(global const uint* tiles, global uint* starts, uint N, uint tile_count) {
  const uint i = get_global_id(0);
  if (i > N) return;
  const uint first = i == 0 ? 0 : tiles[i - 1] + 1, last = i == N ? tile_count : tiles[i];
  for (uint t = first; t <= last; ++t) starts[t] = i;
}

// out [N]: written, values[from[i]]: for values that were not sorted themselves; the sort moved their places (from)
// instead. One work-item per intersection.
kernel void tile_bin_pick(global const uint* from, global const uint* values, global uint* out, uint N) {
  const uint i = get_global_id(0);
  if (i < N) out[i] = values[from[i]];
}
