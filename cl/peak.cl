// Measures the device's peak performance: independent multiply-adds, and a stream through memory. Results are written
// so that the compiler cannot remove the work.
// ```
// define         default  what
// define WIDTH   4        numbers in a vector
// define CHAINS  8        independent sums, each a vector
// ```
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

// Only multiply-adds: steps * CHAINS * WIDTH of them in each work-item.
// ```
// argument    type   shape               what
// steps       int                        rounds
// a           float                      any number unknown to the compiler
// out         f32    [work-items,WIDTH]  written
// work-items  any number
// ```
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

// Only memory: y = a + s b, two reads and a write of each vector.
// ```
// argument    type   shape      what
// n           int               vectors
// s           float             factor
// a, b        f32    [n,WIDTH]  read
// y           f32    [n,WIDTH]  written
// work-items  one per vector
// ```
kernel void peak_stream(int n, float s, global const float* a, global const float* b, global float* y) {
  const size_t i = get_global_id(0);
  if (i < (size_t)n) STORE(FMA(LOAD(i, b), (VEC)(s), LOAD(i, a)), i, y);
}
