// Stable compaction: where flags are set, in ascending order.   A work-item per element.
//   flags [n] (u32, 0 or 1)   positions [n+1], their exclusive prefix sum   indices [positions[n]] (i32)   total [1] (u32)

kernel void compact_indices(global const uint* restrict flags, global const uint* restrict positions,
                            global int* restrict indices, uint n) {
  const uint i = get_global_id(0);
  if (i < n && flags[i]) indices[positions[i]] = (int)i;
}

// A copy of the count where the host can read it by itself. One work-item.
kernel void compact_total(global const uint* restrict positions, global uint* restrict total, uint n) {
  if (get_global_id(0) == 0) total[0] = positions[n];
}
