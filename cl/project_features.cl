// The selected voxels' features as the views see them: each point's bilinear samples, averaged with weights that fall with the
// distance to the view.
//   features [V,t,t,C]   points [P,3]   w2c, c2w [V,4,4]   intrinsics [V,4]   out [P,C]   (f32)
//   out[p] = sum_v a_v sample_v(p) / sum_v a_v with a_v = 1 / (d + 1e-6), d the camera's depth, or with by_distance the distance.
// A work-item takes four channels of a point (direction 1) at a time, those of get_global_id(0), then get_global_size(0) further on.
#include "sample.clh"

static inline float view_weight(float3 point, __global const float* c2w, float depth, int by_distance) {
  const float d = by_distance ? length(point - (float3)(c2w[3], c2w[7], c2w[11])) : depth;
  return 1.0f / (d + 1e-6f);
}

__kernel void project_features_fwd(__global const float* restrict features, __global const float* restrict points,
                                   __global const float* restrict w2c, __global const float* restrict c2w,
                                   __global const float* restrict intrinsics, __global float* restrict out, int P, int V, int t, int C,
                                   float image, float half_pixel, int by_distance) {
  const int p = get_global_id(1);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  float total = 0.0f;
  for (int v = 0; v < V; ++v) {
    const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
    total += view_weight(point, c2w + 16 * v, f.depth, by_distance);
  }
  for (int c = 4 * (int)get_global_id(0); c < C; c += 4 * (int)get_global_size(0)) {
    float4 sum = (float4)(0.0f);
    for (int v = 0; v < V; ++v) {
      const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
      const float4 a = f.weight * (view_weight(point, c2w + 16 * v, f.depth, by_distance) / total);
      __global const float* map = features + (long)v * t * t * C + c;
      __global const float *p0 = map + (long)f.texel.x * C, *p1 = map + (long)f.texel.y * C;
      __global const float *p2 = map + (long)f.texel.z * C, *p3 = map + (long)f.texel.w * C;
      if (c + 4 <= C) {
        sum += a.x * vload4(0, p0) + a.y * vload4(0, p1) + a.z * vload4(0, p2) + a.w * vload4(0, p3);
      } else {
        sum.x += a.x * p0[0] + a.y * p1[0] + a.z * p2[0] + a.w * p3[0];
        if (c + 1 < C) sum.y += a.x * p0[1] + a.y * p1[1] + a.z * p2[1] + a.w * p3[1];
        if (c + 2 < C) sum.z += a.x * p0[2] + a.y * p1[2] + a.z * p2[2] + a.w * p3[2];
      }
    }
    __global float* to = out + (long)p * C + c;
    if (c + 4 <= C) {
      vstore4(sum, 0, to);
    } else {
      to[0] = sum.x;
      if (c + 1 < C) to[1] = sum.y;
      if (c + 2 < C) to[2] = sum.z;
    }
  }
}
