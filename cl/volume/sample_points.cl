// The views' maps at a primitive's place: the bilinear sample of each view's map of 8 numbers a pixel
// (view_maps.cl), the last of them, the drawn depth, as its distance from the point's own depth,
//   out[p, v, 0..6] = m_v(p)[0..6],   out[p, v, 7] = |m_v(p)[7] - z_v(p)|.
// ```
// argument    type   shape      what
// maps        f32    [V,S,S,8]  zero beyond their edges
// points      f32    [P,3]      in the object's frame
// w2c         f32    [V,4,4]    object's frame to camera, row-major
// intrinsics  f32    [V,4]      fx, fy, cx, cy in pixels
// out         f32    [P,V,8]    written
// half_pixel  float             0 or 0.5, see sample.clh
// work-items  one per (point, view)
// ```
#include "sample.clh"

static inline float8 sample_8(global const float* map, Footprint f) {
  float8 s = (float8)(0.0f);
  if (f.weight.x != 0.0f) s += f.weight.x * vload8(f.texel.x, map);
  if (f.weight.y != 0.0f) s += f.weight.y * vload8(f.texel.y, map);
  if (f.weight.z != 0.0f) s += f.weight.z * vload8(f.texel.z, map);
  if (f.weight.w != 0.0f) s += f.weight.w * vload8(f.texel.w, map);
  return s;
}

kernel void sample_points_forward(global const float* restrict maps, global const float* restrict points,
                                  global const float* restrict w2c, global const float* restrict intrinsics,
                                  global float* restrict out, int P, int V, int size, float half_pixel) {
  const int p = get_global_id(0) / V, v = get_global_id(0) % V;
  if (p >= P) return;
  const Footprint f = footprint(vload3(p, points), w2c + 16 * v, vload4(v, intrinsics), (float)size, half_pixel, size);
  float8 s = sample_8(maps + (size_t)v * size * size * 8, f);
  s.s7 = fabs(s.s7 - f.depth);
  vstore8(s, (size_t)p * V + v, out);
}

// Backward, by the points: through the bilinear weights and through the depth. Where the depths are equal the distance
// has no derivative, which counts as 0.
// ```
// argument    type   shape    what
// dout        f32    [P,V,8]  gradient of out
// dpoints     f32    [P,3]    added to
// work-items  one per point
// ```
kernel void sample_points_backward_points(global const float* restrict maps, global const float* restrict points,
                                          global const float* restrict w2c, global const float* restrict intrinsics,
                                          global const float* restrict dout, global float* restrict dpoints, int P,
                                          int V, int size, float half_pixel) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const float3 point = vload3(p, points);
  float3 sum = (float3)(0.0f);
  for (int v = 0; v < V; ++v) {
    global const float *m = w2c + 16 * v, *map = maps + (size_t)v * size * size * 8;
    const float4 k = vload4(v, intrinsics);
    const Footprint f = footprint(point, m, k, (float)size, half_pixel, size);
    float8 d = vload8((size_t)p * V + v, dout);
    d.s7 *= sign(sample_8(map, f).s7 - f.depth);
    float4 h = (float4)(0.0f);
    if (f.inside.x) h.x = dot(d.lo, vload8(f.texel.x, map).lo) + dot(d.hi, vload8(f.texel.x, map).hi);
    if (f.inside.y) h.y = dot(d.lo, vload8(f.texel.y, map).lo) + dot(d.hi, vload8(f.texel.y, map).hi);
    if (f.inside.z) h.z = dot(d.lo, vload8(f.texel.z, map).lo) + dot(d.hi, vload8(f.texel.z, map).hi);
    if (f.inside.w) h.w = dot(d.lo, vload8(f.texel.w, map).lo) + dot(d.hi, vload8(f.texel.w, map).hi);
    sum += footprint_gradient(f, h, point, m, k, (float)size, size) - d.s7 * (float3)(m[8], m[9], m[10]);
  }
  vstore3(vload3(p, dpoints) + sum, p, dpoints);
}

// Backward, by the maps: the input of scatter_rows, which adds to them.
// ```
// argument    type  shape    what
// index       i32   [P,V,4]  written: the texel's row of the maps as [V S S, 8]
// weight      f32   [P,V,4]  written: its bilinear weight
// dsamples    f32   [P,V,8]  written: the gradient by the sample
// work-items  one per (point, view)
// ```
kernel void sample_points_backward_maps(global const float* restrict maps, global const float* restrict points,
                                        global const float* restrict w2c, global const float* restrict intrinsics,
                                        global const float* restrict dout, global int4* restrict index,
                                        global float4* restrict weight, global float* restrict dsamples, int P, int V,
                                        int size, float half_pixel) {
  const int p = get_global_id(0) / V, v = get_global_id(0) % V;
  if (p >= P) return;
  const size_t at = (size_t)p * V + v;
  const Footprint f = footprint(vload3(p, points), w2c + 16 * v, vload4(v, intrinsics), (float)size, half_pixel, size);
  float8 d = vload8(at, dout);
  d.s7 *= sign(sample_8(maps + (size_t)v * size * size * 8, f).s7 - f.depth);
  index[at] = f.texel + v * size * size;
  weight[at] = f.weight;
  vstore8(d, at, dsamples);
}
