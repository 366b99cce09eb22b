// What the device can do at the most: independent multiply-adds, and a stream through memory. Results are written so that nothing is
// optimised away.
#include "common.clh"

#ifndef WIDTH
#define WIDTH 4  // numbers per vector
#endif
#ifndef CHAINS
#define CHAINS 8  // independent sums, vectors each
#endif
#define CAT_(a, b) a##b
#define CAT(a, b) CAT_(a, b)
#define VEC CAT(float, WIDTH)
#define STORE CAT(vstore, WIDTH)
#define LOAD CAT(vload, WIDTH)

// Each work-item does steps * CHAINS * WIDTH multiply-adds. out [work-items, WIDTH]
kernel void peak_fma(int steps, float a, global float* out) {
  const size_t i = get_global_id(0);
  const VEC b = (VEC)(a * 0.5f), c = (VEC)(a);
  VEC s[CHAINS];
#pragma unroll
  for (int j = 0; j < CHAINS; ++j) s[j] = (VEC)((float)(i + j));
  for (int k = 0; k < steps; ++k) {
#pragma unroll
    for (int j = 0; j < CHAINS; ++j) s[j] = FMA(s[j], b, c);
  }
  VEC sum = s[0];
#pragma unroll
  for (int j = 1; j < CHAINS; ++j) sum += s[j];
  STORE(sum, i, out);
}

// y = a + s b over n vectors: two reads and a write of each. One work-item per vector.
kernel void peak_stream(int n, float s, global const float* a, global const float* b, global float* y) {
  const size_t i = get_global_id(0);
  if (i < (size_t)n) STORE(FMA(LOAD(i, b), (VEC)(s), LOAD(i, a)), i, y);
}
