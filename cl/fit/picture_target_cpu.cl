// The target of picture_target.cl on a CPU, for P divisible by 4: a work-item processes BLOCK pixels, four at a time.
// Arguments and results are equal.
#include "common.clh"

#define BLOCK 1024

kernel void picture_target(global const uchar* restrict given, global const uchar* restrict known,
                           global const float* restrict colour, global const float* restrict alpha,
                           global float* restrict target, global float* restrict dalpha, int P, float b0, float b1,
                           float b2, float alpha_weight) {
  const int begin = get_global_id(0) * BLOCK, end = min(P, begin + BLOCK);
  const float16 background = (float16)(b0, b1, b2, b0, b1, b2, b0, b1, b2, b0, b1, b2, 0.0f, 0.0f, 0.0f, 0.0f);
  for (int i = begin; i < end; i += 4) {
    const float16 g = convert_float16(vload16(0, given + 4 * (size_t)i)) * (1.0f / 255.0f);
    float16 want = FMA(1.0f - g.s333777bbbfffffff, background, g.s01245689acdeeeee);
    const int4 is_known = known ? convert_int4(vload4(0, known + i)) != 0 : (int4)(-1);
    if (!all(is_known)) {
      const float8 drawn = vload8(0, colour + 3 * (size_t)i);
      const float4 more = vload4(0, colour + 3 * (size_t)i + 8);
      want = select(clamp((float16)(drawn, more, more), 0.0f, 1.0f), want, is_known.xxxyyyzzzwwwwwww);
    }
    vstore8(want.lo, 0, target + 3 * (size_t)i);
    vstore4(want.hi.lo, 0, target + 3 * (size_t)i + 8);
    if (!dalpha) continue;
    const float4 off = vload4(0, alpha + i) - g.s37bf;
    const float4 slope = off > 0.0f ? (float4)(alpha_weight) : (float4)(-alpha_weight);
    vstore4(is_known && fabs(off) > 0.5f / 255.0f ? slope : (float4)(0.0f), 0, dalpha + i);
  }
}
