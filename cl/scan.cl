// Exclusive prefix sum of n unsigned integers, in levels: blocks of GROUP * EACH elements are summed, the sums are scanned by the
// same kernels one level up, and every block is then scanned from its sum's place.
//   in [n]   out [n+1], out[i] = in[0] + ... + in[i-1], so out[n] is the total (modulo 2^32)   (u32)
// Work-groups of exactly GROUP items, one per block; n >= 1. The order of additions is fixed (and of no matter for integers).

#ifndef GROUP
#define GROUP 64  // work-items of a group, a power of two
#endif
#ifndef EACH
#define EACH 32  // consecutive elements of a work-item, a multiple of 16
#endif

// Sum of the EACH elements from `first` on, those past n counting as 0.
static inline uint sum_of_each(global const uint* in, uint first, uint n) {
  uint total = 0;
  if (first + EACH <= n) {
    uint16 sum = vload16(0, in + first);
    for (uint i = 16; i < EACH; i += 16) sum += vload16(0, in + first + i);
    const uint8 s8 = sum.lo + sum.hi;
    const uint4 s4 = s8.lo + s8.hi;
    total = s4.x + s4.y + s4.z + s4.w;
  } else {
    for (uint i = first; i < n; ++i) total += in[i];
  }
  return total;
}

// sums [number of blocks]: the sum of each block.
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_sums(global const uint* restrict in,
                                                                         global uint* restrict sums, uint n) {
  local uint part[GROUP];
  const uint item = get_local_id(0);
  part[item] = sum_of_each(in, (uint)get_group_id(0) * GROUP * EACH + item * EACH, n);
  for (uint step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step) part[item] += part[item + step];
  }
  if (item == 0) sums[get_group_id(0)] = part[0];
}

// before [number of blocks + 1]: the exclusive scan of the sums; with one block it is not read.
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_blocks(global const uint* restrict in,
                                                                           global const uint* restrict before,
                                                                           global uint* restrict out, uint n) {
  local uint part[2][GROUP];
  const uint item = get_local_id(0);
  const uint first = (uint)get_group_id(0) * GROUP * EACH + item * EACH;
  const uint own = sum_of_each(in, first, n);
  part[0][item] = own;
  uint from = 0;
  for (uint step = 1; step < GROUP; step *= 2) {  // inclusive scan of the items' sums
    barrier(CLK_LOCAL_MEM_FENCE);
    part[1 - from][item] = part[from][item] + (item >= step ? part[from][item - step] : 0u);
    from = 1 - from;
  }
  uint sum = part[from][item] - own;
  if (get_num_groups(0) > 1) sum += before[get_group_id(0)];
  for (uint i = first; i < n && i < first + EACH; ++i) {
    out[i] = sum;
    sum += in[i];
  }
  if (first < n && n - first <= EACH) out[n] = sum;
}
