// The views' features at the selected voxels: the bilinear samples of each point, averaged over the views,
//   out[p] = sum_v a_v sample_v(p) / sum_v a_v,   a_v = 1 / (d + 1e-6),
// where d is the point's depth in the camera or, with by_distance, its distance from the camera.
// ```
// argument    type   shape      what
// features    f32    [V,t,t,C]  feature maps
// points      f32    [P,3]      in the object's frame
// w2c         f32    [V,4,4]    object's frame to camera, row-major
// c2w         f32    [V,4,4]    camera to object's frame, row-major
// intrinsics  f32    [V,4]      fx, fy, cx, cy in pixels
// out         f32    [P,C]      written
// image       float             edge of a picture, pixels
// half_pixel  float             0 or 0.5, see sample.clh
// work-items  cpu: one per point; gpu: (lane, point), where the lanes of a point share its channels
// ```
// Both flavours sum in `out`, view by view.
#include "common.clh"
#include "sample.clh"
#include "vector16.clh"

// a_v of a point, for the view whose c2w is given.
static inline float view_weight(float3 point, global const float* c2w, float depth, int by_distance) {
  const float d = by_distance ? length(point - (float3)(c2w[3], c2w[7], c2w[11])) : depth;
  return 1.0f / (d + 1e-6f);
}

// The sum of a_v over the views.
static inline float weight_of_views(float3 point, global const float* w2c, global const float* c2w, int V,
                                    int by_distance) {
  float total = 0.0f;
  for (int v = 0; v < V; ++v) {
    const float depth = dot(vload4(2, w2c + 16 * v), (float4)(point, 1.0f));
    total += view_weight(point, c2w + 16 * v, depth, by_distance);
  }
  return total;
}

// The contribution of view v to a point: p0 .. p3 point to the first channels of its four texels, a holds their
// weights.
#define TEXELS(v)                                                                                  \
  const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t); \
  const float4 a = f.weight * (view_weight(point, c2w + 16 * v, f.depth, by_distance) / total);    \
  global const float* map = features + (long)v * t * t * C;                                        \
  global const float *p0 = map + (long)f.texel.x * C, *p1 = map + (long)f.texel.y * C;             \
  global const float *p2 = map + (long)f.texel.z * C, *p3 = map + (long)f.texel.w * C;

kernel void project_features_forward_cpu(global const float* restrict features, global const float* restrict points,
                                         global const float* restrict w2c, global const float* restrict c2w,
                                         global const float* restrict intrinsics, global float* restrict out, int P,
                                         int V, int t, int C, float image, float half_pixel, int by_distance) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  global float* to = out + (long)p * C;
  for (int v = 0; v < V; ++v) {
    TEXELS(v)
    int c = 0;
    for (; c + 16 <= C; c += 16) {
      const float16 sum = v == 0 ? (float16)(0.0f) : vload16(0, to + c);
      vstore16(sum + (a.x * vload16(0, p0 + c) + a.y * vload16(0, p1 + c) + a.z * vload16(0, p2 + c) +
                      a.w * vload16(0, p3 + c)),
               0, to + c);
    }
    for (; c < C; ++c) to[c] = (v == 0 ? 0.0f : to[c]) + (a.x * p0[c] + a.y * p1[c] + a.z * p2[c] + a.w * p3[c]);
  }
}

kernel void project_features_forward_gpu(global const float* restrict features, global const float* restrict points,
                                         global const float* restrict w2c, global const float* restrict c2w,
                                         global const float* restrict intrinsics, global float* restrict out, int P,
                                         int V, int t, int C, float image, float half_pixel, int by_distance) {
  const int p = get_global_id(1);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  global float* to = out + (long)p * C;
  for (int v = 0; v < V; ++v) {
    TEXELS(v)
    for (int c = get_global_id(0); c < C; c += get_local_size(0)) {
      to[c] = (v == 0 ? 0.0f : to[c]) + (a.x * p0[c] + a.y * p1[c] + a.z * p2[c] + a.w * p3[c]);
    }
  }
}

// Backward. With n_v = a_v / sum a, the gradient by texel k of view v is n_v weight_k dout[p], which scatter_rows adds
// to the features' gradient from index and weight.
// ```
// argument    type  shape    what
// index       i32   [P,V,4]  written: the texel's row of the features as [V t t, C]
// weight      f32   [P,V,4]  written: n_v weight_k
// work-items  one per point
// ```
kernel void project_features_backward_texels(global const float* restrict points, global const float* restrict w2c,
                                             global const float* restrict c2w, global const float* restrict intrinsics,
                                             global int4* restrict index, global float4* restrict weight, int P, int V,
                                             int t, float image, float half_pixel, int by_distance) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  for (int v = 0; v < V; ++v) {
    const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
    index[(long)p * V + v] = f.texel + v * t * t;
    weight[(long)p * V + v] = f.weight * (view_weight(point, c2w + 16 * v, f.depth, by_distance) / total);
  }
}

// The gradient by the point goes through the bilinear weights, which are linear between texels, and through n_v. Both
// need only these dot products.
// ```
// argument    type  shape    what
// dout        f32   [P,C]    gradient of out
// dots        f32   [P,V,4]  written: sum_c dout[p, c] texel_k[c]; 0 for a texel outside the map
// work-items  cpu: one per (point, view); gpu: groups of DOT_LANES, one per (point, view)
// ```
kernel void project_features_backward_dots_cpu(global const float* restrict features,
                                               global const float* restrict points, global const float* restrict w2c,
                                               global const float* restrict intrinsics,
                                               global const float* restrict dout, global float4* restrict dots, int P,
                                               int V, int t, int C, float image, float half_pixel) {
  const int p = get_global_id(0) / V, v = get_global_id(0) % V;
  if (p >= P) return;
  const Footprint f = footprint(vload3(p, points), w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
  global const float* map = features + (long)v * t * t * C;
  global const float* dy = dout + (long)p * C;
  const int texel[4] = {f.texel.x, f.texel.y, f.texel.z, f.texel.w},
            inside[4] = {f.inside.x, f.inside.y, f.inside.z, f.inside.w};
  float dot_of[4];
  for (int k = 0; k < 4; ++k) {
    dot_of[k] = 0.0f;
    if (!inside[k]) continue;
    global const float* x = map + (long)texel[k] * C;
    float16 sums = (float16)(0.0f);
    for (int c = 0; c < C; c += 16) sums += load_part(x + c, C - c) * load_part(dy + c, C - c);
    dot_of[k] = sum_of(sums);
  }
  dots[(long)p * V + v] = (float4)(dot_of[0], dot_of[1], dot_of[2], dot_of[3]);
}

#define DOT_LANES 64
kernel __attribute__((reqd_work_group_size(DOT_LANES, 1, 1))) void project_features_backward_dots_gpu(
    global const float* restrict features, global const float* restrict points, global const float* restrict w2c,
    global const float* restrict intrinsics, global const float* restrict dout, global float4* restrict dots, int P,
    int V, int t, int C, float image, float half_pixel) {
  local float4 part[DOT_LANES];
  const int pair = GROUP_ID(0), p = pair / V, v = pair % V, lane = get_local_id(0);
  const Footprint f = footprint(vload3(p, points), w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
  global const float* map = features + (long)v * t * t * C;
  global const float* dy = dout + (long)p * C;
  float4 sum = (float4)(0.0f);
  for (int c = lane; c < C; c += DOT_LANES) {
    if (f.inside.x) sum.x += map[(long)f.texel.x * C + c] * dy[c];
    if (f.inside.y) sum.y += map[(long)f.texel.y * C + c] * dy[c];
    if (f.inside.z) sum.z += map[(long)f.texel.z * C + c] * dy[c];
    if (f.inside.w) sum.w += map[(long)f.texel.w * C + c] * dy[c];
  }
  part[lane] = sum;
  for (int half_of = DOT_LANES / 2; half_of > 0; half_of /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_of) part[lane] += part[lane + half_of];
  }
  if (lane == 0) dots[pair] = part[0];
}

// dpoints [P,3]: added to. One work-item per point.
kernel void project_features_backward_points(global const float* restrict points, global const float* restrict w2c,
                                             global const float* restrict c2w, global const float* restrict intrinsics,
                                             global const float4* restrict dots, global float* restrict dpoints, int P,
                                             int V, int t, float image, float half_pixel, int by_distance) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  const float total = weight_of_views(point, w2c, c2w, V, by_distance);
  // As a function of the point, the loss is sum_v n_v g_v with g_v = sum_c dout[p, c] sample_v[c].
  float mean = 0.0f;
  for (int v = 0; v < V; ++v) {
    const Footprint f = footprint(point, w2c + 16 * v, vload4(v, intrinsics), image, half_pixel, t);
    mean += view_weight(point, c2w + 16 * v, f.depth, by_distance) / total * dot(f.weight, dots[(long)p * V + v]);
  }
  float3 sum = (float3)(0.0f);
  for (int v = 0; v < V; ++v) {
    global const float* m = w2c + 16 * v;
    const float4 k = vload4(v, intrinsics), h = dots[(long)p * V + v];
    const Footprint f = footprint(point, m, k, image, half_pixel, t);
    const float a = view_weight(point, c2w + 16 * v, f.depth, by_distance), n = a / total;

    // Through n_v: da_v = -a_v^2 dd_v, and sum_v g_v dn_v = sum_v (g_v - mean) da_v / total. At the camera itself the
    // distance has no derivative, which counts as 0.
    float3 slope = (float3)(m[8], m[9], m[10]);
    if (by_distance) {
      const float3 from = point - (float3)(c2w[16 * v + 3], c2w[16 * v + 7], c2w[16 * v + 11]);
      const float d = length(from);
      slope = d > 0.0f ? from / d : (float3)(0.0f);
    }
    sum -= n * a * (dot(f.weight, h) - mean) * slope;

    sum += n * footprint_gradient(f, h, point, m, k, image, t);
  }
  vstore3(vload3(p, dpoints) + sum, p, dpoints);
}
