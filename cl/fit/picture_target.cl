// The target of a drawn picture, over the background that it was drawn over, and the loss's slope by its alpha.
//   target = c / 255 + (1 - a / 255) background      for a masked pixel: the drawn colour, clamped to [0, 1]
//   dalpha = alpha_weight sign(alpha - a / 255), 0 where they differ by less than half a step of a
// ```
// argument      type       shape    what
// given         u8         [P,4]    red, green, blue premultiplied by a, and a
// known         u8         [P]      0: the pixel is masked out; null: none is
// colour        f32        [P,3]    drawn
// alpha         f32        [P]      drawn
// target        f32        [P,3]    written
// dalpha        f32        [P]      written; null: not written
// b0, b1, b2    float               the background
// alpha_weight  float               increase of the loss for an alpha that is off by 1
// work-items    one per pixel
// ```
#include "common.clh"

kernel void picture_target(global const uchar* restrict given, global const uchar* restrict known,
                           global const float* restrict colour, global const float* restrict alpha,
                           global float* restrict target, global float* restrict dalpha, int P, float b0, float b1,
                           float b2, float alpha_weight) {
  const int i = get_global_id(0);
  if (i >= P) return;
  const bool is_known = known ? known[i] != 0 : true;
  const float4 g = convert_float4(vload4(i, given)) * (1.0f / 255.0f);
  const float through = 1.0f - g.w;
  const float3 want = (float3)(FMA(through, b0, g.x), FMA(through, b1, g.y), FMA(through, b2, g.z));
  const float3 drawn = clamp(vload3(i, colour), 0.0f, 1.0f);
  vstore3(is_known ? want : drawn, i, target);
  if (!dalpha) return;
  const float off = alpha[i] - g.w;
  dalpha[i] = is_known && fabs(off) > 0.5f / 255.0f ? (off > 0.0f ? alpha_weight : -alpha_weight) : 0.0f;
}
