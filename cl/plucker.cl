// The camera ray through the centre of every patch, as numbers that the network reads: its unit direction d and its
// moment o x d (o: the camera's centre), each as the 16 real spherical harmonics up to degree 3 (index n (n + 1) + m).
// They are written as polynomials, so that they are defined off the unit sphere too.
// ```
// argument    type   shape       what
// c2w         f32    [V,4,4]     camera to world, row-major, x right, y down, z forward
// intrinsics  f32    [V,4]       fx, fy, cx, cy in pixels
// out         f32    [V,t,t,32]  written: 16 numbers of the direction, 16 of the moment
// patch       float              edge of a patch, pixels
// work-items  one per patch
// ```
#include "common.clh"

static inline void real_sh3(float3 p, global float* out) {
  const float x = p.x, y = p.y, z = p.z, x2 = x * x, y2 = y * y, z2 = z * z;
  out[0] = 0.282094791773878f;
  out[1] = -0.48860251190292f * y;
  out[2] = 0.48860251190292f * z;
  out[3] = -0.48860251190292f * x;
  out[4] = 1.09254843059208f * x * y;
  out[5] = -1.09254843059208f * y * z;
  out[6] = 0.94617469575756f * z2 - 0.31539156525252f;
  out[7] = -1.09254843059208f * x * z;
  out[8] = 0.54627421529604f * (x2 - y2);
  out[9] = -0.590043589926644f * y * (3.0f * x2 - y2);
  out[10] = 2.89061144264055f * x * y * z;
  out[11] = 0.304697199642977f * y * (1.5f - 7.5f * z2);
  out[12] = 1.24392110863372f * z * (1.5f * z2 - 0.5f) - 0.497568443453487f * z;
  out[13] = 0.304697199642977f * x * (1.5f - 7.5f * z2);
  out[14] = 1.44530572132028f * z * (x2 - y2);
  out[15] = -0.590043589926644f * x * (x2 - 3.0f * y2);
}

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
