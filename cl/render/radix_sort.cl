// Stable radix sort, least significant digit first. One pass orders by one digit, the bits of `mask` after `shift`:
// histogram, exclusive scan of the histogram, scatter. In the cpu flavour, which has few blocks, the scatter does the
// scan, too: a launch takes longer than that. A block is a run of `block` keys that its owner reads in order,
// so equal digits keep their order, and nothing depends on timing.
// ```
// argument           type     shape            what
// keys               u32      [n]              u64 with -DKEY64
// values             u32      [n]              moved with the keys; null: each key's index
// histogram          u32      [mask+1,blocks]  written by the histogram: the number of keys of each digit in each block
// offsets            u32      [mask+1,blocks]  the histogram's exclusive scan; gpu flavour only
// out_keys           as keys  [n]              written by the scatter; not keys itself
// out_values         u32      [n]              written by the scatter; not values itself
// define DIGIT_BITS  8                         bits of the largest digit: mask < 2^DIGIT_BITS
// define KEY64                                 keys of 64 bits
// define WG                                    gpu flavour: work-items of a group
// work-items         cpu: one per block, with its counters in private memory; gpu: groups of WG, one per block, each
//                    item a run of block / WG keys, with counters [digit][item] in local memory
// ```
#include "common.clh"

#ifndef DIGIT_BITS
#define DIGIT_BITS 8
#endif
#define DIGITS (1 << DIGIT_BITS)
#ifdef KEY64
typedef ulong key_type;
#else
typedef uint key_type;
#endif

static inline uint digit_of(key_type key, int shift, uint mask) { return (uint)(key >> shift) & mask; }

#ifndef WG
kernel void radix_histogram_cpu(global const key_type* keys, global uint* histogram, uint n, uint block, uint blocks,
                                int shift, uint mask) {
  const uint b = get_global_id(0);
  if (b >= blocks) return;
  uint count[DIGITS];
  for (uint d = 0; d <= mask; ++d) count[d] = 0;
  const uint end = min(n, (b + 1) * block);
  for (uint i = b * block; i < end; ++i) ++count[digit_of(keys[i], shift, mask)];
  for (uint d = 0; d <= mask; ++d) histogram[d * blocks + b] = count[d];
}

kernel void radix_scatter_cpu(global const key_type* keys, global const uint* values, global const uint* histogram,
                              global key_type* out_keys, global uint* out_values, uint n, uint block, uint blocks,
                              int shift, uint mask) {
  const uint b = get_global_id(0);
  if (b >= blocks) return;
  uint at[DIGITS], sum = 0;
  for (uint d = 0; d <= mask; ++d) {
    for (uint other = 0; other < blocks; ++other) {
      if (other == b) at[d] = sum;
      sum += histogram[d * blocks + other];
    }
  }
  const uint end = min(n, (b + 1) * block);
  for (uint i = b * block; i < end; ++i) {
    const key_type key = keys[i];
    const uint to = at[digit_of(key, shift, mask)]++;
    out_keys[to] = key;
    out_values[to] = values ? values[i] : i;
  }
}
#else

// count [mask + 1][WG]: the number of keys of each digit in each item's run. Ends with a barrier.
static inline void count_runs(global const key_type* keys, local uint* count, uint begin, uint end, int shift,
                              uint mask) {
  const uint item = get_local_id(0);
  for (uint d = 0; d <= mask; ++d) count[d * WG + item] = 0;
  for (uint i = begin; i < end; ++i) ++count[digit_of(keys[i], shift, mask) * WG + item];
  barrier(CLK_LOCAL_MEM_FENCE);
}

kernel void radix_histogram_gpu(global const key_type* keys, global uint* histogram, uint n, uint block, uint blocks,
                                int shift, uint mask) {
  local uint count[DIGITS * WG];
  const uint item = get_local_id(0), b = GROUP_ID(0), run = block / WG;
  const uint begin = min(n, b * block + item * run), end = min(n, begin + run);
  count_runs(keys, count, begin, end, shift, mask);
  for (uint d = item; d <= mask; d += WG) {
    uint sum = 0;
    for (int j = 0; j < WG; ++j) sum += count[d * WG + j];
    histogram[d * blocks + b] = sum;
  }
}

kernel void radix_scatter_gpu(global const key_type* keys, global const uint* values, global const uint* offsets,
                              global key_type* out_keys, global uint* out_values, uint n, uint block, uint blocks,
                              int shift, uint mask) {
  local uint count[DIGITS * WG];
  const uint item = get_local_id(0), b = GROUP_ID(0), run = block / WG;
  const uint begin = min(n, b * block + item * run), end = min(n, begin + run);
  count_runs(keys, count, begin, end, shift, mask);
  // The place of each item's run of each digit.
  for (uint d = item; d <= mask; d += WG) {
    uint at = offsets[d * blocks + b];
    for (int j = 0; j < WG; ++j) {
      const uint c = count[d * WG + j];
      count[d * WG + j] = at;
      at += c;
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = begin; i < end; ++i) {
    const key_type key = keys[i];
    const uint to = count[digit_of(key, shift, mask) * WG + item]++;
    out_keys[to] = key;
    out_values[to] = values ? values[i] : i;
  }
}
#endif
