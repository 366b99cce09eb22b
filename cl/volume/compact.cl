// Stable compaction: the places where flags are set, in ascending order.
// ```
// argument    type  shape           what
// flags       u32   [n]             0 or 1
// positions   u32   [n+1]           exclusive prefix sum of the flags; positions[n] is their number
// indices     i32   [positions[n]]  written: where flags are set
// total       u32   [1]             written by compact_total: positions[n]
// work-items  one per element
// ```

kernel void compact_indices(global const uint* restrict flags, global const uint* restrict positions,
                            global int* restrict indices, uint n) {
  const uint i = get_global_id(0);
  if (i < n && flags[i]) indices[positions[i]] = (int)i;
}

// Copies the count to a place where the host reads it without the rest. One work-item.
kernel void compact_total(global const uint* restrict positions, global uint* restrict total, uint n) {
  if (get_global_id(0) == 0) total[0] = positions[n];
}
