// The camera ray through the centre of every patch, as numbers that the network reads: its unit direction d and its
// moment o x d (o: the camera's centre), each as real spherical harmonics (plucker.clh).
// ```
// argument    type   shape       what
// c2w         f32    [V,4,4]     camera to world, row-major, x right, y down, z forward
// intrinsics  f32    [V,4]       fx, fy, cx, cy in pixels
// out         f32    [V,t,t,32]  written: 16 numbers of the direction, 16 of the moment
// patch       float              edge of a patch, pixels
// work-items  one per patch
// ```
#include "plucker.clh"

kernel void plucker(global const float* c2w, global const float* intrinsics, global float* out, int V, int t,
                    float patch) {
  const int i = get_global_id(0);
  if (i >= V * t * t) return;
  const int v = i / (t * t), py = i / t % t, px = i % t;
  global const float* m = c2w + v * 16;
  global const float* k = intrinsics + v * 4;
  const float dx = ((px + 0.5f) * patch - k[2]) / k[0], dy = ((py + 0.5f) * patch - k[3]) / k[1];
  float3 d = (float3)(m[0] * dx + m[1] * dy + m[2], m[4] * dx + m[5] * dy + m[6], m[8] * dx + m[9] * dy + m[10]);
  d = d / sqrt(d.x * d.x + d.y * d.y + d.z * d.z);
  const float3 o = (float3)(m[3], m[7], m[11]);
  real_sh3(d, out + (size_t)i * 32);
  real_sh3((float3)(o.y * d.z - o.z * d.y, o.z * d.x - o.x * d.z, o.x * d.y - o.y * d.x), out + (size_t)i * 32 + 16);
}
