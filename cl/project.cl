// Gaussians to the picture: the projection of 3D Gaussian splatting.
// ```
// argument      type  shape    what
// means         f32   [K,3]    world units. The K Gaussians may be a chunk of a larger scene, whose Gaussian `base`
//                              comes first
// scales        f32   [K,3]    standard deviations, world units
// quats         f32   [K,4]    w x y z, of any length > 0
// opacities     f32   [K]      o, in 0 to 1
// sh            f32   [K,S,3]  spherical harmonics, S = 1, 4, 9 or 16 coefficients
// views         f32   [..,32]  cameras, of which `view` is meant
// define WIDTH                 Gaussians of a work-item, 1 or 16
// work-items    one per WIDTH Gaussians, in both kernels
// ```
// A camera's numbers:
// ```
// numbers   what
// 0 .. 8    rotation world to camera, row-major
// 9 .. 11   the camera's centre
// 12 .. 14  what rounding took from the centre: the two add up to it
// 15 .. 18  fx, fy, cx, cy in pixels; pixel centres are at + 0.5
// 19, 20    the largest |x/z| and |y/z| that enter the Jacobian
// 21        near plane, >= 0
// 22 .. 24  where colours are seen from
// 25 .. 27  what rounding took from that
// ```
// The covariance [a b; b c] of a Gaussian in the picture has the determinant det = |s1 x s2|^2 + 0.3 (a + c) + 0.09,
// with a and c before 0.3 is added to them, by the cross product of the Jacobian's rows: exact for needles and discs,
// where a c - b^2 is not.
#include "rasterize.clh"

#define DILATION 0.3f
#define LOG2E 1.44269504088896341f

#if WIDTH == 1
typedef float real;
typedef uint ureal;
typedef int ireal;
#define AS_REAL as_float
#define AS_IREAL as_int
#define TO_REAL convert_float
#define TO_UREAL convert_uint_rtz
#else
typedef float16 real;
typedef uint16 ureal;
typedef int16 ireal;
#define AS_REAL as_float16
#define AS_IREAL as_int16
#define TO_REAL convert_float16
#define TO_UREAL convert_uint16_rtz
#endif

typedef struct {
  real x, y, z;
} real3;

static inline real dot3(real3 a, real3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// WIDTH of the chunk's Gaussians: numbers `first` and up of the n, or of the `ids` where these are given (less `base`).
// Beyond the n-th the last one is repeated.
typedef struct {
  real3 mean, scale;
  real w, i, j, k, opacity;  // quaternion w + i + j + k
} Batch;

#if WIDTH == 1
static inline Batch load_batch(global const float* means, global const float* scales, global const float* quats,
                               global const float* opacities, global const uint* ids, int first, int base, int n) {
  const size_t at = ids ? ids[first] - base : first;
  const float3 m = vload3(at, means), s = vload3(at, scales);
  const float4 q = vload4(at, quats);
  const Batch out = {{m.x, m.y, m.z}, {s.x, s.y, s.z}, q.x, q.y, q.z, q.w, opacities[at]};
  return out;
}
#else
// 16 rows of three numbers, as three vectors.
static inline real3 load_rows(global const float* p) {
  const float16 a = vload16(0, p), b = vload16(1, p), c = vload16(2, p);
  const real3 out = {(float16)(a.s0369, a.scf, b.s258b, b.se, c.s147a, c.sd),
                     (float16)(a.s147a, a.sd, b.s0369, b.scf, c.s258b, c.se),
                     (float16)(a.s258b, a.se, b.s147a, b.sd, c.s0369, c.scf)};
  return out;
}

static inline Batch load_batch(global const float* means, global const float* scales, global const float* quats,
                               global const float* opacities, global const uint* ids, int first, int base, int n) {
  Batch out;
  const int full = first + 16 <= n;
  const size_t begin = ids ? ids[first] - base : first;
  if (full && (!ids || ids[first + 15] - base == begin + 15)) {  // side by side, as they mostly are
    out.mean = load_rows(means + 3 * begin);
    out.scale = load_rows(scales + 3 * begin);
    global const float* p = quats + 4 * begin;
    const float16 a = vload16(0, p), b = vload16(1, p), c = vload16(2, p), d = vload16(3, p);
    out.w = (float16)(a.s048c, b.s048c, c.s048c, d.s048c);
    out.i = (float16)(a.s159d, b.s159d, c.s159d, d.s159d);
    out.j = (float16)(a.s26ae, b.s26ae, c.s26ae, d.s26ae);
    out.k = (float16)(a.s37bf, b.s37bf, c.s37bf, d.s37bf);
    out.opacity = vload16(0, opacities + begin);
    return out;
  }
  float rows[11][16];
  for (int l = 0; l < 16; ++l) {
    const int item = min(first + l, n - 1);
    const size_t at = ids ? ids[item] - base : item;
    const float3 m = vload3(at, means), s = vload3(at, scales);
    const float4 q = vload4(at, quats);
    rows[0][l] = m.x, rows[1][l] = m.y, rows[2][l] = m.z, rows[3][l] = s.x, rows[4][l] = s.y, rows[5][l] = s.z;
    rows[6][l] = q.x, rows[7][l] = q.y, rows[8][l] = q.z, rows[9][l] = q.w, rows[10][l] = opacities[at];
  }
  out.mean.x = vload16(0, rows[0]), out.mean.y = vload16(0, rows[1]), out.mean.z = vload16(0, rows[2]);
  out.scale.x = vload16(0, rows[3]), out.scale.y = vload16(0, rows[4]), out.scale.z = vload16(0, rows[5]);
  out.w = vload16(0, rows[6]), out.i = vload16(0, rows[7]), out.j = vload16(0, rows[8]), out.k = vload16(0, rows[9]);
  out.opacity = vload16(0, rows[10]);
  return out;
}
#endif

// The Gaussian in the picture: covariance [a b; b c] in pixels^2 about (u, v), its determinant, and (a - c) / 2 without
// the rounding of the 0.3 that is added to both.
typedef struct {
  real u, v, z, a, b, c, det, half_diff;
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
  const real q2 = g.w * g.w + g.i * g.i + g.j * g.j + g.k * g.k;
  // The rotation of a quaternion of any length has products of its numbers times 2 / |q|^2; length 0 is no rotation.
  const real n = select((real)(0.0f), 2.0f / q2, q2 > 0.0f);
  const real3 r0 = {1.0f - n * (g.j * g.j + g.k * g.k), n * (g.i * g.j + g.w * g.k), n * (g.i * g.k - g.w * g.j)};
  const real3 r1 = {n * (g.i * g.j - g.w * g.k), 1.0f - n * (g.i * g.i + g.k * g.k), n * (g.j * g.k + g.w * g.i)};
  const real3 r2 = {n * (g.i * g.k + g.w * g.j), n * (g.j * g.k - g.w * g.i), 1.0f - n * (g.i * g.i + g.j * g.j)};
  const real3 s1 = {dot3(j1, r0) * g.scale.x, dot3(j1, r1) * g.scale.y, dot3(j1, r2) * g.scale.z};
  const real3 s2 = {dot3(j2, r0) * g.scale.x, dot3(j2, r1) * g.scale.y, dot3(j2, r2) * g.scale.z};
  const real3 sn = {dot3(jn, r0) * (g.scale.y * g.scale.z), dot3(jn, r1) * (g.scale.x * g.scale.z),
                    dot3(jn, r2) * (g.scale.x * g.scale.y)};
  const real a0 = dot3(s1, s1), c0 = dot3(s2, s2);
  s.a = a0 + DILATION;
  s.b = dot3(s1, s2);
  s.c = c0 + DILATION;
  s.det = dot3(sn, sn) + DILATION * (a0 + c0) + DILATION * DILATION;
  s.half_diff = 0.5f * (a0 - c0);
  return s;
}

// log2 of a normal number > 0, wrong by 1e-7 at the most: x = 2^e m with m between 1 / sqrt(2) and sqrt(2), and log m =
// 2 atanh((m - 1) / (m + 1)) by its series. (A driver's own log2 may take vectors apart.)
static inline real log2_of(real x) {
  const ireal bits = AS_IREAL(x) - 0x3f3504f3;
  const real m = AS_REAL((bits & 0x007fffff) + 0x3f3504f3), s = (m - 1.0f) / (m + 1.0f), s2 = s * s;
  const real series =
      FMA(FMA(FMA(FMA(s2, (real)(1.0f / 9), (real)(1.0f / 7)), s2, (real)(1.0f / 5)), s2, (real)(1.0f / 3)), s2,
          (real)(1.0f));
  return FMA(2.0f * LOG2E * s, series, TO_REAL(bits >> 23));
}

// How many standard deviations from its middle a Gaussian's alpha can reach 1/255: sqrt(2 ln(255 o)), and a little
// more, so that rounding cannot matter.
static inline real sigmas_of(real log2_opacity) {
  return sqrt(max((2.0f / LOG2E) * (log2_opacity + LOG2_255), 0.0f) + 1e-5f) * 1.001f;
}

// Tiles from x0 to x1 along one axis, of `tiles`, as x0 | x1 << 16: those of the original rasteriser's square (about u
// - 0.5; fractions are cut off towards 0, not rounded down), and of them those with a pixel centre within `reach` of u.
// 0 if there is none.
static inline ureal tile_span(real u, real radius, real reach, float tiles) {
  const real ud = u - 0.5f, none = 0.0f, most = tiles;
  const real x0 = clamp((ud - radius) * (1.0f / TILE), none, most);
  const real x1 = clamp((ud + radius + (float)(TILE - 1)) * (1.0f / TILE), none, most);
  const real t0 = clamp((ud - reach) * (1.0f / TILE), none, most);
  const real t1 = clamp(floor((ud + reach) * (1.0f / TILE)) + 1.0f, none, most);
  const ureal from = TO_UREAL(max(x0, t0)), to = min(TO_UREAL(x1), TO_UREAL(t1));
  return select((ureal)(0), from | to << 16, from < to);
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
  const real sigmas = sigmas_of(log2_of(g.opacity));
  const real reach_x = sigmas * sqrt(s.a) + 0.01f, reach_y = sigmas * sqrt(s.c) + 0.01f;
  // Not finite where any of them is infinite or no number.
  const real finite = (s.u + s.v) + (s.det + radius) + (reach_x + reach_y);
  const ireal seen = (s.z > camera[21]) & (g.opacity >= MIN_ALPHA) & isfinite(finite);
  const ureal x = tile_span(s.u, radius, reach_x, tiles_x), y = tile_span(s.v, radius, reach_y, tiles_y);
  const ireal drawn = seen & (x != 0) & (y != 0);
  const ureal rx = select((ureal)(0), x, drawn), ry = select((ureal)(0), y, drawn);
  global uint* out = rects + 2 * (size_t)(base + first);
#if WIDTH == 1
  vstore2((uint2)(rx, ry), 0, out);
  keys[base + first] = as_uint(s.z);
#else
  const uint16 low = (uint16)(rx.s0, ry.s0, rx.s1, ry.s1, rx.s2, ry.s2, rx.s3, ry.s3, rx.s4, ry.s4, rx.s5, ry.s5, rx.s6,
                              ry.s6, rx.s7, ry.s7);
  const uint16 high = (uint16)(rx.s8, ry.s8, rx.s9, ry.s9, rx.sa, ry.sa, rx.sb, ry.sb, rx.sc, ry.sc, rx.sd, ry.sd,
                               rx.se, ry.se, rx.sf, ry.sf);
  if (first + 16 <= n) {
    vstore16(low, 0, out);
    vstore16(high, 1, out);
    vstore16(as_uint16(s.z), 0, keys + base + first);
  } else {
    uint pairs[32], depth[16];
    vstore16(low, 0, pairs);
    vstore16(high, 1, pairs);
    vstore16(as_uint16(s.z), 0, depth);
    for (int l = 0; l < n - first; ++l) {
      out[2 * l] = pairs[2 * l];
      out[2 * l + 1] = pairs[2 * l + 1];
      keys[base + first + l] = depth[l];
    }
  }
#endif
}

// Real spherical harmonics with the Condon-Shortley sign, as 3DGS stores colour, at unit directions.
static inline void sh_basis(real3 d, int count, real* basis) {
  basis[0] = 0.28209479177387814f;
  if (count > 1) {
    basis[1] = -0.4886025119029199f * d.y;
    basis[2] = 0.4886025119029199f * d.z;
    basis[3] = -0.4886025119029199f * d.x;
  }
  if (count > 4) {
    const real xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
    basis[4] = 1.0925484305920792f * d.x * d.y;
    basis[5] = -1.0925484305920792f * d.y * d.z;
    basis[6] = 0.31539156525252005f * (2.0f * zz - xx - yy);
    basis[7] = -1.0925484305920792f * d.x * d.z;
    basis[8] = 0.5462742152960396f * (xx - yy);
    if (count > 9) {
      basis[9] = -0.5900435899266435f * d.y * (3.0f * xx - yy);
      basis[10] = 2.890611442640554f * d.x * d.y * d.z;
      basis[11] = -0.4570457994644658f * d.y * (4.0f * zz - xx - yy);
      basis[12] = 0.3731763325901154f * d.z * (2.0f * zz - 3.0f * xx - 3.0f * yy);
      basis[13] = -0.4570457994644658f * d.x * (4.0f * zz - xx - yy);
      basis[14] = 1.445305721320277f * d.z * (xx - yy);
      basis[15] = -0.5900435899266435f * d.x * (xx - 3.0f * yy);
    }
  }
}

// The unit direction from where colours are seen from to a mean; 0 where they are the same place.
static inline real3 direction_of(real3 mean, global const float* camera) {
  real3 d = {(mean.x - camera[22]) - camera[25], (mean.y - camera[23]) - camera[26],
             (mean.z - camera[24]) - camera[27]};
  const real length2 = dot3(d, d), r = select((real)(0.0f), rsqrt(length2), length2 > 0.0f);
  d.x *= r, d.y *= r, d.z *= r;
  return d;
}

// One Gaussian's colour, of which negative parts are not yet 0, from its S coefficients c [S,3]. basis: every WIDTH-th
// number is its.
static inline float3 colour_of(const float* basis, global const float* c, int S) {
#if WIDTH == 1
  float3 colour = 0.5f;
  for (int i = 0; i < S; ++i) colour += basis[i] * vload3(i, c);
  return colour;
#else
  // Four numbers at a time: the next coefficient's red comes along and is not used.
  float4 even = 0.5f, odd = 0.0f;
  int i = 0;
  for (; i + 2 < S; i += 2) {
    even += basis[16 * i] * vload4(0, c + 3 * i);
    odd += basis[16 * (i + 1)] * vload4(0, c + 3 * (i + 1));
  }
  for (; i < S; ++i) odd.xyz += basis[16 * i] * vload3(i, c);
  return even.xyz + odd.xyz;
#endif
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
  const real lo = log2_of(g.opacity), reach = sigmas_of(lo) * sqrt(s.c) + 0.01f, ra = 1.0f / s.a;
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
