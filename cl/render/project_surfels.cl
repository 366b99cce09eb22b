// Projects surfels to the picture, as in 2D Gaussian splatting. A surfel is flat: centre p, unit tangents t_u and
// t_v (the first two columns of its rotation), two standard deviations, and the normal n (the third column). The ray
// through a pixel meets its plane in one point, (s, t) in deviations along the tangents; the Gaussian is taken there.
// ```
// argument      type  shape    what
// scales        f32   [K,2]    standard deviations along t_u and t_v, world units
// current       int            0: LaRa's rasteriser; 1: the later one
// means .. view                as in project.cl, and so are the cameras
// define WIDTH                 as in project.cl
// work-items    one per WIDTH surfels, in both kernels
// ```
// The two rasterisers differ in two points: the low pass is centred on the box of one deviation (LaRa) or of three, and
// the tiles are those of a square around the pixel's corner or its centre.
//
// With dx, dy from a pixel to the projected centre, a ray meets the plane at
//   (s, t) = ((m11 dx + m12 dy) / h, (m21 dx + m22 dy) / h), h = 1 + g1 dx + g2 dy, in the depth z / h:
// with d = (dx / fx, dy / fy, 0) and N = n . p / z, s = (p x t_v) . d / (s_u N), t = -(p x t_u) . d / (s_v N) and
// h = 1 - n . d / N. That is the product of differences (x Tw - Tu) x (y Tw - Tv) of the paper, in which, taken about
// the projected centre, large numbers cancel before they are rounded.
#define SURFELS
#include "project.clh"

// A surfel in the picture; the record below documents the names.
typedef struct {
  real u, v, z, m11, m12, m21, m22, g1, g2, ex, ey, reach_x, reach_y, radius;
  real3 normal;
  ireal there;  // whether it has a box and is not seen edge on
} Shape;

// The box of the ellipse of `cut2` squared deviations, about (u, v): its middle, and half its size squared. It has one
// where the ellipse lies in front of the camera: where `below` < 0.
typedef struct {
  real x, y, half2_x, half2_y, below;
} Box;

static inline Box box_of(real cut2, real aw_x, real aw_y, real aa_x, real aa_y, real ww, real z) {
  Box b;
  b.below = cut2 * ww - z * z;
  const real f = cut2 / b.below;
  b.x = f * aw_x;
  b.y = f * aw_y;
  b.half2_x = b.x * b.x - f * aa_x;
  b.half2_y = b.y * b.y - f * aa_y;
  return b;
}

static inline real3 turned(global const float* camera, real3 a) {
  const real3 out = {camera[0] * a.x + camera[1] * a.y + camera[2] * a.z,
                     camera[3] * a.x + camera[4] * a.y + camera[5] * a.z,
                     camera[6] * a.x + camera[7] * a.y + camera[8] * a.z};
  return out;
}

static inline Shape shape_of(Batch g, real sigmas, global const float* camera, int current) {
  const float fx = camera[15], fy = camera[16];
  const real3 d = {(g.mean.x - camera[9]) - camera[12], (g.mean.y - camera[10]) - camera[13],
                   (g.mean.z - camera[11]) - camera[14]};
  const real3 p = turned(camera, d);
  const Rotation r = rotation_of(g);
  const real3 tu = turned(camera, r.c0), tv = turned(camera, r.c1), n = turned(camera, r.c2);
  Shape s;
  s.z = p.z;
  const real rz = 1.0f / p.z, xz = p.x * rz, yz = p.y * rz;
  s.u = fx * xz + camera[17];
  s.v = fy * yz + camera[18];
  const real N = n.x * xz + n.y * yz + n.z, rn = 1.0f / N;
  const real side = select((real)(-1.0f), (real)(1.0f), N < 0.0f);  // 1 where the normal faces the camera
  s.normal.x = side * n.x, s.normal.y = side * n.y, s.normal.z = side * n.z;
  const real iu = p.z * rn / g.scale.x, iv = p.z * rn / g.scale.y;
  s.m11 = (1.0f / fx) * iu * (yz * tv.z - tv.y);
  s.m12 = (1.0f / fy) * iu * (tv.x - xz * tv.z);
  s.m21 = (1.0f / fx) * iv * (tu.y - yz * tu.z);
  s.m22 = (1.0f / fy) * iv * (xz * tu.z - tu.x);
  s.g1 = (-1.0f / fx) * n.x * rn;
  s.g2 = (-1.0f / fy) * n.y * rn;

  // The surfel's points lie at (u, v) + A (s, t) z / (z + w . (s, t)).
  const real w1 = g.scale.x * tu.z, w2 = g.scale.y * tv.z;
  const real a11 = fx * g.scale.x * (tu.x - xz * tu.z), a12 = fx * g.scale.y * (tv.x - xz * tv.z);
  const real a21 = fy * g.scale.x * (tu.y - yz * tu.z), a22 = fy * g.scale.y * (tv.y - yz * tv.z);
  const real aw_x = a11 * w1 + a12 * w2, aw_y = a21 * w1 + a22 * w2, ww = w1 * w1 + w2 * w2;
  const real aa_x = a11 * a11 + a12 * a12, aa_y = a21 * a21 + a22 * a22;
  const Box box = box_of(current ? 9.0f : 1.0f, aw_x, aw_y, aa_x, aa_y, ww, p.z);
  s.ex = box.x;
  s.ey = box.y;
  const real half2 = max(box.half2_x, box.half2_y);
  s.radius =
      current ? ceil(max(sqrt(max(half2, 1e-4f)), 2.121318f)) : ceil(3.0f * max(sqrt(max(half2, 0.0f)), 0.707106781f));
  // Alpha reaches 1/255 within `sigmas` deviations on the surfel, or pixels times sqrt(1/2) about the box's centre.
  const Box seen = box_of(sigmas * sigmas, aw_x, aw_y, aa_x, aa_y, ww, p.z);
  const ireal bounded = seen.below < -1e-3f * p.z * p.z;
  const real low = 0.70711f * sigmas;
  s.reach_x =
      select((real)(1e30f), max(fabs(seen.x) + sqrt(max(seen.half2_x, 0.0f)), fabs(s.ex) + low) + 0.01f, bounded);
  s.reach_y =
      select((real)(1e30f), max(fabs(seen.y) + sqrt(max(seen.half2_y, 0.0f)), fabs(s.ey) + low) + 0.01f, bounded);
  s.there = (N != 0.0f) & (box.below != 0.0f);
  return s;
}

// For every surfel of the chunk, at its place in the scene:
// ```
// argument          type  shape   what
// rects             u32   [..,2]  written: x0 | x1 << 16 and y0 | y1 << 16 of the tiles that it may touch, as in
//                                 project.cl; 0, 0 where it is culled (z <= near, opacity < 1/255, edge on, outside,
//                                 not finite). They are those of the original rasteriser's square, less those in which
//                                 alpha stays below 1/255 everywhere
// keys              u32   [..]    written: as in project.cl
// n                 int           surfels of the chunk
// tiles_x, tiles_y  int           tiles of the picture
// ```
kernel void project_surfels_cull(global const float* means, global const float* scales, global const float* quats,
                                 global const float* opacities, global const float* views, int view, int current,
                                 global uint* rects, global uint* keys, int base, int n, int tiles_x, int tiles_y) {
  const int first = get_global_id(0) * WIDTH;
  if (first >= n) return;
  global const float* camera = views + (size_t)view * 32;
  const Batch g = load_batch(means, scales, quats, opacities, 0, first, base, n);
  const Shape s = shape_of(g, sigmas_of(log2_of(g.opacity)), camera, current);
  // Not finite if any of them is infinite or NaN.
  const real finite = (s.u + s.v) + (s.ex + s.ey) + (s.m11 + s.m12 + s.m21 + s.m22) + (s.g1 + s.g2 + s.radius);
  const ireal seen = (s.z > camera[21]) & (g.opacity >= MIN_ALPHA) & s.there & isfinite(finite);
  const real ud = s.u - 0.5f, vd = s.v - 0.5f, to_middle = current ? 0.0f : 0.5f;
  const ureal x = tile_span(ud + s.ex + to_middle, s.radius, ud, s.reach_x, tiles_x);
  const ureal y = tile_span(vd + s.ey + to_middle, s.radius, vd, s.reach_y, tiles_y);
  write_culled(x, y, s.z, seen, base + first, n - first, rects, keys);
}

// For the n surfels ids[from] .. ids[from + n - 1] (indices into the scene):
// ```
// argument  type  shape    what
// sh        f32   [K,S,3]  as in project.cl
// ids       u32   [..]     those that are seen
// records   f32   [..,20]  written: rows from .. from + n - 1
// ```
// A record is:
// ```
// numbers   what
// 0, 1      u, v: where the centre is, pixels
// 2         log2 of the opacity
// 3         z in the camera
// 4 .. 7    m11, m12, m21, m22: see above
// 8 .. 11   g1, g2; ex, ey: from (u, v) to the centre of the box, pixels
// 12 .. 15  red, green, blue; reach_x: alpha < 1/255 where |dx| is more, pixels
// 16 .. 19  the normal in the camera's axes, towards the camera; reach_y
// ```
kernel void project_surfels_forward(global const float* means, global const float* scales, global const float* quats,
                                    global const float* opacities, global const float* sh, global const float* views,
                                    int view, int current, global const uint* ids, global float* records, int base,
                                    int from, int n, int S) {
  const int first = get_global_id(0) * WIDTH;
  if (first >= n) return;
  ids += from;
  records += (size_t)(from + first) * 20;
  global const float* camera = views + (size_t)view * 32;
  const Batch g = load_batch(means, scales, quats, opacities, ids, first, base, n);
  const real lo = log2_of(g.opacity);
  const Shape s = shape_of(g, sigmas_of(lo), camera, current);
  real basis[16];
  sh_basis(direction_of(g.mean, camera), S, basis);
#if WIDTH == 1
  const float3 colour = max(colour_of(basis, sh + (size_t)(ids[first] - base) * S * 3, S), 0.0f);
  vstore4((float4)(s.u, s.v, lo, s.z), 0, records);
  vstore4((float4)(s.m11, s.m12, s.m21, s.m22), 1, records);
  vstore4((float4)(s.g1, s.g2, s.ex, s.ey), 2, records);
  vstore4((float4)(colour, s.reach_x), 3, records);
  vstore4((float4)(s.normal.x, s.normal.y, s.normal.z, s.reach_y), 4, records);
#else
  const real columns[] = {s.u,  s.v,  lo,   s.z,       s.m11,      s.m12,      s.m21,      s.m22,    s.g1,
                          s.g2, s.ex, s.ey, s.reach_x, s.normal.x, s.normal.y, s.normal.z, s.reach_y};
  const float* rows = (const float*)columns;
  const int end = min(n - first, 16);
  for (int l = 0; l < end; ++l) {
    global float* record = records + (size_t)l * 20;
    const float3 colour =
        max(colour_of((const float*)basis + l, sh + (size_t)(ids[first + l] - base) * S * 3, S), 0.0f);
    for (int i = 0; i < 12; ++i) record[i] = rows[16 * i + l];
    vstore4((float4)(colour, rows[16 * 12 + l]), 3, record);
    for (int i = 13; i < 17; ++i) record[3 + i] = rows[16 * i + l];
  }
#endif
}
