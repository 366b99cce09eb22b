// Gaussians to the picture: 3D Gaussian splatting's projection, one work-item per Gaussian.
//   means [K,3], scales [K,3] (standard deviations), quats [K,4] (w x y z, any length > 0), opacities [K],
//   sh [K,S,3], S = 1, 4, 9 or 16; world units.
//   views [V,32], of which camera `view`: 0-8 rotation world-to-camera row-major, 9-11 camera centre and 12-14 what rounding took from it,
//   15-18 fx fy cx cy (pixels, pixel centres at +0.5), 19-20 largest |x/z|, |y/z| in the Jacobian, 21 near (>= 0),
//   22-24 where colours are seen from, 25-27 what rounding took from it.
// Writes, per Gaussian:
//   records [K,12]: u, v (pixels), reach (pixels: alpha < 1/255 where |dy| is more), z (camera);
//     log2(opacity), k, qx, qy with log2 alpha = log2(opacity) + qx dx^2 + qy (dy - k dx)^2: a sum of squares, in which
//     nothing cancels however thin the Gaussian;  r, g, b, 0.
//   rects [K,2]: x0 | x1 << 16 and y0 | y1 << 16, tiles of 16 x 16 pixels, end exclusive. The square of tiles that the
//     3-sigma radius touches, less those in which alpha stays below 1/255 everywhere.
//   counts [K]: tiles in it, 0 where culled (z <= near, opacity < 1/255, outside, not finite): its record is not written.
//   keys [K]: z's bits, which order as z does; 0xffffffff where culled.
// Here det = |s1 x s2|^2 + 0.3 (a + c) + 0.09 by the cross product of the Jacobian's rows, which is exact for needles
// and discs where a c - b^2 is not.
#include "common.clh"

#define TILE 16
#define MIN_ALPHA (1.0f / 255.0f)
#define DILATION 0.3f
#define LOG2E 1.44269504088896341f

// Colour as 3DGS stores it: real spherical harmonics with the Condon-Shortley sign.
static inline float3 sh_colour(global const float* c, int count, float3 d) {
  float3 sum = 0.28209479177387814f * vload3(0, c);
  if (count > 1) {
    sum += -0.4886025119029199f * d.y * vload3(1, c) + 0.4886025119029199f * d.z * vload3(2, c) -
           0.4886025119029199f * d.x * vload3(3, c);
  }
  if (count > 4) {
    const float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    sum += 1.0925484305920792f * d.x * d.y * vload3(4, c) - 1.0925484305920792f * d.y * d.z * vload3(5, c) +
           0.31539156525252005f * (2.0f * zz - xx - yy) * vload3(6, c) -
           1.0925484305920792f * d.x * d.z * vload3(7, c) + 0.5462742152960396f * (xx - yy) * vload3(8, c);
    if (count > 9) {
      sum += -0.5900435899266435f * d.y * (3.0f * xx - yy) * vload3(9, c) +
             2.890611442640554f * d.x * d.y * d.z * vload3(10, c) -
             0.4570457994644658f * d.y * (4.0f * zz - xx - yy) * vload3(11, c) +
             0.3731763325901154f * d.z * (2.0f * zz - 3.0f * xx - 3.0f * yy) * vload3(12, c) -
             0.4570457994644658f * d.x * (4.0f * zz - xx - yy) * vload3(13, c) +
             1.445305721320277f * d.z * (xx - yy) * vload3(14, c) -
             0.5900435899266435f * d.x * (xx - 3.0f * yy) * vload3(15, c);
    }
  }
  return max(sum + 0.5f, 0.0f);
}

// Tiles [x, y) along one axis, of `tiles`: those of the reference's square (about u - 0.5, cut off, not rounded down),
// and of them those with a pixel centre within `reach` of u.
static inline uint2 tile_span(float u, float radius, float reach, int tiles) {
  const float ud = u - 0.5f, most = (float)tiles;
  const float x0 = clamp((ud - radius) / TILE, 0.0f, most), x1 = clamp((ud + radius + (TILE - 1)) / TILE, 0.0f, most);
  const float t0 = clamp((ud - reach) / TILE, 0.0f, most), t1 = clamp(floor((ud + reach) / TILE) + 1.0f, 0.0f, most);
  return (uint2)(max((uint)x0, (uint)t0), min((uint)x1, (uint)t1));
}

kernel void project(global const float* means, global const float* scales, global const float* quats,
                    global const float* opacities, global const float* sh, global const float* views, int view,
                    global float* records, global uint* rects, global uint* counts, global uint* keys, int K, int S, int tiles_x, int tiles_y) {
  const int i = get_global_id(0);
  if (i >= K) return;
  counts[i] = 0;
  keys[i] = 0xffffffffu;

  global const float* camera = views + (size_t)view * 32;
  const float3 W0 = vload3(0, camera), W1 = vload3(1, camera), W2 = vload3(2, camera);
  const float3 mean = vload3(i, means);
  const float3 d = (mean - vload3(3, camera)) - vload3(4, camera);
  const float z = dot(W2, d);
  const float opacity = opacities[i];
  if (!(z > camera[21]) || !(opacity >= MIN_ALPHA)) return;
  const float fx = camera[15], fy = camera[16];
  const float rz = 1.0f / z, xz = dot(W0, d) * rz, yz = dot(W1, d) * rz;
  const float u = fx * xz + camera[17], v = fy * yz + camera[18];

  // Rows of J W: fx/z (W0 - x/z W2), fy/z (W1 - y/z W2); their cross product is fx fy / z^2 (x/z W0 + y/z W1 + W2).
  const float sx = clamp(xz, -camera[19], camera[19]), sy = clamp(yz, -camera[20], camera[20]);
  const float3 j1 = fx * rz * (W0 - sx * W2), j2 = fy * rz * (W1 - sy * W2);
  const float3 jn = fx * fy * rz * rz * (sx * W0 + sy * W1 + W2);
  float4 q = vload4(i, quats);
  const float q2 = dot(q, q);
  q *= q2 > 0.0f ? rsqrt(q2) : 0.0f;  // none at all: no rotation
  const float3 r0 = (float3)(1.0f - 2.0f * (q.z * q.z + q.w * q.w), 2.0f * (q.y * q.z + q.x * q.w), 2.0f * (q.y * q.w - q.x * q.z));
  const float3 r1 = (float3)(2.0f * (q.y * q.z - q.x * q.w), 1.0f - 2.0f * (q.y * q.y + q.w * q.w), 2.0f * (q.z * q.w + q.x * q.y));
  const float3 r2 = (float3)(2.0f * (q.y * q.w + q.x * q.z), 2.0f * (q.z * q.w - q.x * q.y), 1.0f - 2.0f * (q.y * q.y + q.z * q.z));
  const float3 s = vload3(i, scales);
  const float3 s1 = (float3)(dot(j1, r0), dot(j1, r1), dot(j1, r2)) * s;
  const float3 s2 = (float3)(dot(j2, r0), dot(j2, r1), dot(j2, r2)) * s;
  const float3 sn = (float3)(dot(jn, r0) * s.y * s.z, dot(jn, r1) * s.x * s.z, dot(jn, r2) * s.x * s.y);
  const float a0 = dot(s1, s1), c0 = dot(s2, s2), b = dot(s1, s2);
  const float a = a0 + DILATION, c = c0 + DILATION;
  const float det = dot(sn, sn) + DILATION * (a0 + c0) + DILATION * DILATION;

  const float half_diff = 0.5f * (a0 - c0);
  const float radius = ceil(3.0f * sqrt(0.5f * (a + c) + sqrt(max(half_diff * half_diff + b * b, 0.1f))));
  // alpha >= 1/255 within sqrt(2 ln(255 o)) standard deviations; a little more, so that rounding cannot matter.
  const float sigmas = sqrt(2.0f * log(opacity * 255.0f) + 1e-5f) * 1.001f;
  const float reach_x = sigmas * sqrt(a) + 0.01f, reach_y = sigmas * sqrt(c) + 0.01f;
  // Far outside, or not a number at all.
  if (!(isfinite(u) && isfinite(v) && isfinite(det) && isfinite(radius) && isfinite(reach_x) && isfinite(reach_y))) return;
  const uint2 tx = tile_span(u, radius, reach_x, tiles_x), ty = tile_span(v, radius, reach_y, tiles_y);
  if (tx.x >= tx.y || ty.x >= ty.y) return;

  float3 seen = (mean - (float3)(camera[22], camera[23], camera[24])) - (float3)(camera[25], camera[26], camera[27]);
  const float length2 = dot(seen, seen);
  seen *= length2 > 0.0f ? rsqrt(length2) : 0.0f;
  const float3 colour = sh_colour(sh + (size_t)i * S * 3, S, seen);

  global float* out = records + (size_t)i * 12;
  vstore4((float4)(u, v, reach_y, z), 0, out);
  vstore4((float4)(log2(opacity), b / a, -0.5f * LOG2E / a, -0.5f * LOG2E * (a / det)), 1, out);
  vstore4((float4)(colour, 0.0f), 2, out);
  rects[2 * i] = tx.x | tx.y << 16;
  rects[2 * i + 1] = ty.x | ty.y << 16;
  counts[i] = (tx.y - tx.x) * (ty.y - ty.x);
  keys[i] = as_uint(z);
}
