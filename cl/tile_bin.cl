// Which Gaussians each tile of the picture sees, near to far.
//   ids [K]: Gaussians in order of depth. rects, counts as project.cl writes them. offsets [K+1]: exclusive scan of the
//   counts in that order. An intersection is a pair of a tile (row-major) and a Gaussian, N of them in all.

// Sums of `block` counts each, in 64 bits: N itself may not fit 32.
kernel void tile_bin_total(global const uint* counts, global ulong* sums, int K, int block, int blocks) {
  const int b = get_global_id(0);
  if (b >= blocks) return;
  ulong sum = 0;
  const int end = min(K, (b + 1) * block);
  for (int i = b * block; i < end; ++i) sum += counts[i];
  sums[b] = sum;
}

kernel void tile_bin_gather(global const uint* counts, global const uint* ids, global uint* ordered, int K) {
  const int i = get_global_id(0);
  if (i < K) ordered[i] = counts[ids[i]];
}

// tiles [N], gaussians [N]: in order of depth, so that a stable sort by tile leaves each tile near to far.
kernel void tile_bin_emit(global const uint* rects, global const uint* ids, global const uint* offsets,
                          global uint* tiles, global uint* gaussians, int K, int tiles_x) {
  const int i = get_global_id(0);
  if (i >= K) return;
  uint at = offsets[i];
  if (at == offsets[i + 1]) return;
  const uint id = ids[i], x = rects[2 * id], y = rects[2 * id + 1];
  for (uint ty = y & 0xffff; ty < y >> 16; ++ty) {
    for (uint tx = x & 0xffff; tx < x >> 16; ++tx) {
      tiles[at] = ty * tiles_x + tx;
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
