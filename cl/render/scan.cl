// Exclusive prefix sum of unsigned integers, in levels. Blocks of GROUP * EACH elements are summed (scan_sums); the
// sums are scanned by the same kernels one level up; then every block is scanned from its own start value
// (scan_blocks).
// ```
// argument      type  shape       what
// in            u32   [n]         n >= 1
// sums          u32   [blocks]    written by scan_sums: the sum of each block
// before        u32   [blocks+1]  exclusive scan of the sums; null if there is one block
// out           u32   [n+1]       written: out[i] = in[0] + ... + in[i-1], so that out[n] is the total (modulo 2^32)
// define GROUP  64                work-items of a group, a power of two
// define EACH   32                consecutive elements of a work-item, a multiple of 16
// work-items    groups of exactly GROUP items, one group per block
// ```
// The order of the additions is fixed, though it does not matter for integers.
#include "common.clh"

#ifndef GROUP
#define GROUP 64
#endif
#ifndef EACH
#define EACH 32
#endif

// The sum of the EACH elements from `first` on; those past n count as 0.
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

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_sums(global const uint* restrict in,
                                                                         global uint* restrict sums, uint n) {
  local uint part[GROUP];
  const uint item = get_local_id(0);
  part[item] = sum_of_each(in, (uint)GROUP_ID(0) * GROUP * EACH + item * EACH, n);
  for (uint step = GROUP / 2; step > 0; step /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (item < step) part[item] += part[item + step];
  }
  if (item == 0) sums[GROUP_ID(0)] = part[0];
}

kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_blocks(global const uint* restrict in,
                                                                           global const uint* restrict before,
                                                                           global uint* restrict out, uint n) {
  local uint part[2][GROUP];
  const uint item = get_local_id(0);
  const uint first = (uint)GROUP_ID(0) * GROUP * EACH + item * EACH;
  const uint own = sum_of_each(in, first, n);
  part[0][item] = own;
  uint from = 0;
  for (uint step = 1; step < GROUP; step *= 2) {  // inclusive scan of the items' sums
    barrier(CLK_LOCAL_MEM_FENCE);
    part[1 - from][item] = part[from][item] + (item >= step ? part[from][item - step] : 0u);
    from = 1 - from;
  }
  uint sum = part[from][item] - own;
  if (before) sum += before[GROUP_ID(0)];
  for (uint i = first; i < n && i < first + EACH; ++i) {
    out[i] = sum;
    sum += in[i];
  }
  if (first < n && n - first <= EACH) out[n] = sum;
}
