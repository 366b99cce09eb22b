// Neighbours of active voxels, for submanifold convolutions.
// ```
// argument    type  shape   what
// index       i32   [P]     active voxels as (i R + j) R + k, no two equal
// grid        i32   [R^3]   the active voxel's row + 1, 0 if the voxel is not active; zeros before sparse_map_grid
//                           writes it
// map         i32   [P,27]  written: the row of the voxel at offset (a-1, b-1, c-1) for tap (3a + b) 3 + c, where a
//                           goes along x; -1 if that voxel is not active or outside the grid
// work-items  one per active voxel, in both kernels
// ```

kernel void sparse_map_grid(global const int* restrict index, global int* restrict grid, int P) {
  const int p = get_global_id(0);
  if (p < P) grid[index[p]] = p + 1;
}

kernel void sparse_map_forward(global const int* restrict index, global const int* restrict grid,
                               global int* restrict map, int P, int R) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const int x = index[p] / (R * R), y = index[p] / R % R, z = index[p] % R;
  for (int tap = 0; tap < 27; ++tap) {
    const int i = x + tap / 9 - 1, j = y + tap / 3 % 3 - 1, k = z + tap % 3 - 1;
    const bool inside = i >= 0 && i < R && j >= 0 && j < R && k >= 0 && k < R;
    map[(long)p * 27 + tap] = inside ? grid[(i * R + j) * R + k] - 1 : -1;
  }
}
