// The Gaussians that a part of the picture sees. The part is the tiles x0 to x1 and y0 to y1, ends exclusive. Both
// kernels go through blocks of `block` Gaussians in order.
// ```
// argument     type  shape       what
// rects        u32   [K,2]       for all Gaussians, in tiles of the whole picture, as project_cull writes them
// keys         u32   [K]         for all Gaussians, as project_cull writes them
// sums         u64   [blocks,4]  written by visible_count: the number of visible ones, the tiles that they touch in
//                                all, their smallest and their largest key
// ids          u32   [V]         written by visible_compact: visible ones, ascending
// seen_rects   u32   [V,2]       written: their rects, clipped to the part and counted from its corner
// seen_keys    u32   [V]         written: their keys less `least`
// define WIDE                    16 Gaussians at a time (cpu flavour)
// work-items   one per block
// ```

// A rect's two words, clipped to the part and relative to its corner; both are 0 if nothing is left.
static inline uint2 clipped(uint2 rect, uint x0, uint x1, uint y0, uint y1) {
  const uint l = max(rect.x & 0xffff, x0), r = min(rect.x >> 16, x1);
  const uint t = max(rect.y & 0xffff, y0), b = min(rect.y >> 16, y1);
  if (l >= r || t >= b) return (uint2)(0);
  return (uint2)((l - x0) | (r - x0) << 16, (t - y0) | (b - y0) << 16);
}

kernel void visible_count(global const uint* rects, global const uint* keys, global ulong* sums, int K, int block,
                          int blocks, uint x0, uint x1, uint y0, uint y1) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  ulong tiles = 0;
  uint seen = 0, least = 0xffffffffu, largest = 0;
  const int end = min(K, (b + 1) * block);
  int i = b * block;
#ifdef WIDE  // 16 at a time
  ulong16 tiles16 = 0;
  uint16 seen16 = 0, least16 = 0xffffffffu, largest16 = 0;
  for (; i + 16 <= end; i += 16) {
    const uint16 p = vload16(0, rects + 2 * (size_t)i), q = vload16(1, rects + 2 * (size_t)i),
                 key = vload16(0, keys + i);
    const uint16 x = (uint16)(p.s02468ace, q.s02468ace), y = (uint16)(p.s13579bdf, q.s13579bdf);
    const uint16 l = max(x & 0xffff, x0), r = min(x >> 16, x1), t = max(y & 0xffff, y0), u = min(y >> 16, y1);
    const uint16 in = as_uint16((l < r) & (t < u));
    seen16 += in & 1;
    tiles16 += convert_ulong16(((r - l) & in)) * convert_ulong16(((u - t) & in));
    least16 = min(least16, key | ~in);
    largest16 = max(largest16, key & in);
  }
  const uint8 s8 = seen16.lo + seen16.hi, l8 = min(least16.lo, least16.hi), m8 = max(largest16.lo, largest16.hi);
  const uint4 s4 = s8.lo + s8.hi, l4 = min(l8.lo, l8.hi), m4 = max(m8.lo, m8.hi);
  const ulong8 t8 = tiles16.lo + tiles16.hi;
  const ulong4 t4 = t8.lo + t8.hi;
  seen = s4.x + s4.y + s4.z + s4.w;
  tiles = t4.x + t4.y + t4.z + t4.w;
  least = min(min(l4.x, l4.y), min(l4.z, l4.w));
  largest = max(max(m4.x, m4.y), max(m4.z, m4.w));
#endif
  for (; i < end; ++i) {
    const uint2 rect = clipped(vload2(i, rects), x0, x1, y0, y1);
    if (rect.y == 0) continue;
    const uint key = keys[i];
    ++seen;
    tiles += (ulong)((rect.x >> 16) - (rect.x & 0xffff)) * ((rect.y >> 16) - (rect.y & 0xffff));
    least = min(least, key);
    largest = max(largest, key);
  }
  vstore4((ulong4)(seen, tiles, least, largest), b, sums);
}

kernel void visible_compact(global const uint* rects, global const uint* keys, global const ulong* sums,
                            global uint* ids, global uint* seen_rects, global uint* seen_keys, int K, int block,
                            int blocks, uint least, uint x0, uint x1, uint y0, uint y1) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  size_t at = 0;
  for (int i = 0; i < b; ++i) at += sums[4 * i];
  const int end = min(K, (b + 1) * block);
  for (int i = b * block; i < end; ++i) {
    const uint2 rect = clipped(vload2(i, rects), x0, x1, y0, y1);
    if (rect.y == 0) continue;
    ids[at] = i;
    vstore2(rect, at, seen_rects);
    seen_keys[at++] = keys[i] - least;
  }
}
