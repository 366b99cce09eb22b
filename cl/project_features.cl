// The selected voxels' features as the views see them: each point's bilinear samples, averaged with weights that fall with the
// distance to the view.
//   features [V,t,t,C]   points [P,3]   w2c, c2w [V,4,4]   intrinsics [V,4]   out [P,C]   (f32)
//   out[p] = sum_v a_v sample_v(p) / sum_v a_v with a_v = 1 / (d + 1e-6), d the camera's depth, or with by_distance the distance.
// _cpu: a work-item per point. _gpu: work-items (lane, p), the lanes of a point share its channels. Both add up in `out`, view by view.
#include "sample.clh"

static inline float view_weight(float3 point, __global const float* c2w, float depth, int by_distance) {
  const float d = by_distance ? length(point - (float3)(c2w[3], c2w[7], c2w[11])) : depth;
  return 1.0f / (d + 1e-6f);
}

// The views' weights of a point, added up.
static inline float weight_of_views(float3 point, __global const float* w2c, __global const float* c2w, int V, int by_distance) {
  float total = 0.0f;
  for (int v = 0; v < V; ++v) {
    const float depth = dot(vload4(2, w2c + 16 * v), (float4)(point, 1.0f));
    total += view_weight(point, c2w + 16 * v, depth, by_distance);
  }
  return total;
}

// Where view v sees the point: p0..p3 at the first channel of its four texels, with their weights.
#define TEXELS(v)                                                                                                         \
  const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);                        \
  const float4 a = f.weight * (view_weight(point, c2w + 16 * v, f.depth, by_distance) / total);                           \
  __global const float* map = features + (long)v * t * t * C;                                                             \
  __global const float *p0 = map + (long)f.texel.x * C, *p1 = map + (long)f.texel.y * C;                                  \
  __global const float *p2 = map + (long)f.texel.z * C, *p3 = map + (long)f.texel.w * C;

__kernel void project_features_cpu(__global const float* restrict features, __global const float* restrict points,
                                   __global const float* restrict w2c, __global const float* restrict c2w,
                                   __global const float* restrict intrinsics, __global float* restrict out, int P, int V, int t, int C,
                                   float image, float half_pixel, int by_distance) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  __global float* to = out + (long)p * C;
  for (int v = 0; v < V; ++v) {
    TEXELS(v)
    int c = 0;
    for (; c + 16 <= C; c += 16) {
      const float16 sum = v == 0 ? (float16)(0.0f) : vload16(0, to + c);
      vstore16(sum + (a.x * vload16(0, p0 + c) + a.y * vload16(0, p1 + c) + a.z * vload16(0, p2 + c) + a.w * vload16(0, p3 + c)), 0,
               to + c);
    }
    for (; c < C; ++c) to[c] = (v == 0 ? 0.0f : to[c]) + (a.x * p0[c] + a.y * p1[c] + a.z * p2[c] + a.w * p3[c]);
  }
}

__kernel void project_features_gpu(__global const float* restrict features, __global const float* restrict points,
                                   __global const float* restrict w2c, __global const float* restrict c2w,
                                   __global const float* restrict intrinsics, __global float* restrict out, int P, int V, int t, int C,
                                   float image, float half_pixel, int by_distance) {
  const int p = get_global_id(1);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  __global float* to = out + (long)p * C;
  for (int v = 0; v < V; ++v) {
    TEXELS(v)
    for (int c = get_global_id(0); c < C; c += get_global_size(0)) {
      to[c] = (v == 0 ? 0.0f : to[c]) + (a.x * p0[c] + a.y * p1[c] + a.z * p2[c] + a.w * p3[c]);
    }
  }
}
