// Projects Gaussians to the picture, as in 3D Gaussian splatting.
// ```
// argument      type  shape    what
// means         f32   [K,3]    world units. The K Gaussians may be a chunk of a larger scene, whose Gaussian `base`
//                              comes first
// scales        f32   [K,3]    standard deviations, world units
// quats         f32   [K,4]    w x y z, of any length > 0
// opacities     f32   [K]      o, in 0 to 1
// sh            f32   [K,S,3]  spherical harmonics, S = 1, 4, 9 or 16 coefficients
// views         f32   [..,32]  cameras; `view` is the index of the one in use
// define WIDTH                 Gaussians of a work-item, 1 or 16
// define ANTIALIAS             opacities are multiplied by sqrt(D / det), below: what is smaller than a pixel fades
//                              instead of growing (Mip-Splatting, Yu et al. 2024)
// work-items    one per WIDTH Gaussians, in both kernels
// ```
// A camera's numbers:
// ```
// numbers   what
// 0 .. 8    rotation world to camera, row-major
// 9 .. 11   the camera's centre
// 12 .. 14  the centre's rounding error: the two add up to the centre
// 15 .. 18  fx, fy, cx, cy in pixels; pixel centres are at + 0.5
// 19, 20    the largest |x/z| and |y/z| that enter the Jacobian
// 21        near plane, >= 0
// 22 .. 24  the point that colours are seen from
// 25 .. 27  its rounding error
// ```
// The covariance [a b; b c] of a Gaussian in the picture has the determinant det = D + 0.3 (a + c) + 0.09, with a and c
// before 0.3 is added to them, and D = |s1 x s2|^2, the determinant before that, by the cross product of the Jacobian's
// rows: exact for needles and discs, where a c - b^2 is not.
#include "project.clh"

#define DILATION 0.3f

// The Gaussian in the picture: covariance [a b; b c] in pixels^2 about (u, v), its determinant, and (a - c) / 2 without
// the rounding of the 0.3 that is added to both; and its opacity there.
typedef struct {
  real u, v, z, a, b, c, det, half_diff, opacity;
} Shape;

static inline Shape shape_of(Batch g, global const float* camera) {
  const float w0 = camera[0], w1 = camera[1], w2 = camera[2], w3 = camera[3], w4 = camera[4], w5 = camera[5];
  const float w6 = camera[6], w7 = camera[7], w8 = camera[8], fx = camera[15], fy = camera[16];
  const real3 d = {(g.mean.x - camera[9]) - camera[12], (g.mean.y - camera[10]) - camera[13],
                   (g.mean.z - camera[11]) - camera[14]};
  Shape s;
  s.z = w6 * d.x + w7 * d.y + w8 * d.z;
  const real rz = 1.0f / s.z, xz = (w0 * d.x + w1 * d.y + w2 * d.z) * rz, yz = (w3 * d.x + w4 * d.y + w5 * d.z) * rz;
  s.u = fx * xz + camera[17];
  s.v = fy * yz + camera[18];

  // Rows of J W: fx/z (W0 - x/z W2), fy/z (W1 - y/z W2); their cross product is fx fy / z^2 (x/z W0 + y/z W1 + W2).
  const real sx = clamp(xz, (real)(-camera[19]), (real)(camera[19])),
             sy = clamp(yz, (real)(-camera[20]), (real)(camera[20]));
  const real fxz = fx * rz, fyz = fy * rz, fn = fxz * fyz;
  const real3 j1 = {fxz * (w0 - sx * w6), fxz * (w1 - sx * w7), fxz * (w2 - sx * w8)};
  const real3 j2 = {fyz * (w3 - sy * w6), fyz * (w4 - sy * w7), fyz * (w5 - sy * w8)};
  const real3 jn = {fn * (sx * w0 + sy * w3 + w6), fn * (sx * w1 + sy * w4 + w7), fn * (sx * w2 + sy * w5 + w8)};
  const Rotation r = rotation_of(g);
  const real3 s1 = {dot3(j1, r.c0) * g.scale.x, dot3(j1, r.c1) * g.scale.y, dot3(j1, r.c2) * g.scale.z};
  const real3 s2 = {dot3(j2, r.c0) * g.scale.x, dot3(j2, r.c1) * g.scale.y, dot3(j2, r.c2) * g.scale.z};
  const real3 sn = {dot3(jn, r.c0) * (g.scale.y * g.scale.z), dot3(jn, r.c1) * (g.scale.x * g.scale.z),
                    dot3(jn, r.c2) * (g.scale.x * g.scale.y)};
  const real a0 = dot3(s1, s1), c0 = dot3(s2, s2), det0 = dot3(sn, sn);
  s.a = a0 + DILATION;
  s.b = dot3(s1, s2);
  s.c = c0 + DILATION;
  s.det = det0 + DILATION * (a0 + c0) + DILATION * DILATION;
  s.half_diff = 0.5f * (a0 - c0);
#ifdef ANTIALIAS
  s.opacity = g.opacity * sqrt(det0 / s.det);
#else
  s.opacity = g.opacity;
#endif
  return s;
}

// For every Gaussian of the chunk, at its place in the scene:
// ```
// argument          type  shape   what
// rects             u32   [..,2]  written: x0 | x1 << 16 and y0 | y1 << 16 of the tiles of 16 x 16 pixels that it may
//                                 touch, ends exclusive; 0, 0 where it is culled (z <= near, opacity < 1/255, outside,
//                                 not finite). They are the square of tiles that the 3-sigma radius touches, less those
//                                 in which alpha stays below 1/255 everywhere
// keys              u32   [..]    written: the bits of its camera z, which order as z does (of those that are not
//                                 culled)
// n                 int           Gaussians of the chunk
// tiles_x, tiles_y  int           tiles of the picture
// ```
kernel void project_cull(global const float* means, global const float* scales, global const float* quats,
                         global const float* opacities, global const float* views, int view, global uint* rects,
                         global uint* keys, int base, int n, int tiles_x, int tiles_y) {
  const int first = get_global_id(0) * WIDTH;
  if (first >= n) return;
  global const float* camera = views + (size_t)view * 32;
  const Batch g = load_batch(means, scales, quats, opacities, 0, first, base, n);
  const Shape s = shape_of(g, camera);
  const real radius =
      ceil(3.0f * sqrt(0.5f * (s.a + s.c) + sqrt(max(s.half_diff * s.half_diff + s.b * s.b, (real)(0.1f)))));
  const real sigmas = sigmas_of(log2_of(s.opacity));
  const real reach_x = sigmas * sqrt(s.a) + 0.01f, reach_y = sigmas * sqrt(s.c) + 0.01f;
  // Not finite if any of them is infinite or NaN.
  const real finite = (s.u + s.v) + (s.det + radius) + (reach_x + reach_y);
  const ireal seen = (s.z > camera[21]) & (s.opacity >= MIN_ALPHA) & isfinite(finite);
  const real ud = s.u - 0.5f, vd = s.v - 0.5f;
  const ureal x = tile_span(ud, radius, ud, reach_x, tiles_x), y = tile_span(vd, radius, vd, reach_y, tiles_y);
  write_culled(x, y, s.z, seen, base + first, n - first, rects, keys);
}

static inline void write_record(float4 place, float4 form, float3 colour, global float* record) {
  vstore4(place, 0, record);
  vstore4(form, 1, record);
  vstore4((float4)(max(colour, 0.0f), 0.0f), 2, record);
}

// For the n Gaussians ids[from] .. ids[from + n - 1] (indices into the scene):
// ```
// argument  type  shape    what
// ids       u32   [..]     those that are seen
// records   f32   [..,12]  written: rows from .. from + n - 1
// ```
// A record is:
// ```
// numbers  what
// 0, 1     u, v: where the middle is, pixels
// 2        reach: alpha < 1/255 where |dy| is more, pixels
// 3        z in the camera
// 4 .. 7   log2 o, k, qx, qy, with log2 alpha = log2 o + qx dx^2 + qy (dy - k dx)^2 (o: opacity): a sum of squares, in
//          which nothing cancels however thin the Gaussian is
// 8 .. 10  red, green, blue
// 11       0
// ```
kernel void project_forward(global const float* means, global const float* scales, global const float* quats,
                            global const float* opacities, global const float* sh, global const float* views, int view,
                            global const uint* ids, global float* records, int base, int from, int n, int S) {
  const int first = get_global_id(0) * WIDTH;
  if (first >= n) return;
  ids += from;
  records += (size_t)from * 12;
  global const float* camera = views + (size_t)view * 32;
  const Batch g = load_batch(means, scales, quats, opacities, ids, first, base, n);
  const Shape s = shape_of(g, camera);
  const real lo = log2_of(s.opacity), reach = sigmas_of(lo) * sqrt(s.c) + 0.01f, ra = 1.0f / s.a;
  const real k = s.b * ra, qx = -0.5f * LOG2E * ra, qy = -0.5f * LOG2E * (s.a / s.det);
  real basis[16];
  sh_basis(direction_of(g.mean, camera), S, basis);
#if WIDTH == 1
  const float3 colour = colour_of(basis, sh + (size_t)(ids[first] - base) * S * 3, S);
  write_record((float4)(s.u, s.v, reach, s.z), (float4)(lo, k, qx, qy), colour, records + (size_t)first * 12);
#else
  float rows[8][16];
  vstore16(s.u, 0, rows[0]);
  vstore16(s.v, 0, rows[1]);
  vstore16(reach, 0, rows[2]);
  vstore16(s.z, 0, rows[3]);
  vstore16(lo, 0, rows[4]);
  vstore16(k, 0, rows[5]);
  vstore16(qx, 0, rows[6]);
  vstore16(qy, 0, rows[7]);
  const int end = min(n - first, 16);
  for (int l = 0; l < end; ++l) {
    const float3 colour = colour_of((const float*)basis + l, sh + (size_t)(ids[first + l] - base) * S * 3, S);
    write_record((float4)(rows[0][l], rows[1][l], rows[2][l], rows[3][l]),
                 (float4)(rows[4][l], rows[5][l], rows[6][l], rows[7][l]), colour, records + (size_t)(first + l) * 12);
  }
#endif
}
