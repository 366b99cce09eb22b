// Flags the k largest of n numbers, equal ones in their order: their bits are turned into keys with the reverse order,
// the keys are sorted (radix_sort.cl), and the first ones are flagged.
// ```
// argument    type  shape  what
// x           f32   [n]    the numbers; 0 and -0 are equal
// keys        u32   [n]    written: ascending where x descends
// work-items  one per number, in both kernels
// ```
kernel void top_k_keys(global const float* restrict x, global uint* restrict keys, int n) {
  const int i = get_global_id(0);
  if (i >= n) return;
  uint bits = as_uint(x[i]);
  if (bits << 1 == 0u) bits = 0u;
  keys[i] = bits >> 31 ? bits : ~(bits | 0x80000000u);
}

// ```
// argument    type  shape  what
// order       u32   [n]    the numbers' indices, largest first
// flags       u32   [n]    written: 1 for the first k of them, else 0
// others      u32   [n]    written: 1 - flags; null: not written
// ```
kernel void top_k_flags(global const uint* restrict order, global uint* restrict flags, global uint* restrict others,
                        int n, int k) {
  const int i = get_global_id(0);
  if (i >= n) return;
  const uint to = order[i];
  flags[to] = i < k ? 1u : 0u;
  if (others) others[to] = i < k ? 0u : 1u;
}
