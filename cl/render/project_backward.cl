// Projection (project.cl) differentiated: from the rows of rasterize_backward.cl to gradients of the Gaussians and of
// the camera's pose.
// ```
// argument         type  shape    what
// means .. view                   as in project.cl: a chunk of a larger scene, whose Gaussian `base` comes first
// mirrored         int            whether colours are seen from the camera's mirror image
// ids              u32   [N]      the visible Gaussians, as indices into the scene; those of other chunks are
//                                 left to other launches
// records          f32   [N,12]   of the visible Gaussians, as project.cl writes them
// rows             f32   [M,10]   of the intersections, as rasterize_backward.cl writes them
// touched          u8    [M]      whether a row was written
// offsets          u32   [N+1]    visible Gaussian i has the rows offsets[i] .. offsets[i + 1] - 1
// dmeans, dscales  f32   [K,3]    added to
// dquats           f32   [K,4]    added to: by the quaternion as given, of any length
// dopacities       f32   [K]      added to
// dsh              f32   [K,S,3]  added to
// dpose            f32   [N,6]    written: the gradient by (omega, tau) at 0, where the pose is exp([omega, tau]) times
//                                 world to camera; null: not written
// define ANTIALIAS                as in project.cl
// work-items       one per visible Gaussian
// ```
// As in the forward, these count as constant: tiles, culling, the limits of the Jacobian, and a colour clamped to 0.
#include "many_registers.clh"
#include "project_backward.clh"

#define COLUMNS 10
#define DILATION 0.3f  // as in project.cl
#define LN2 0.693147180559945309f

// The sums of a Gaussian's rows over its tiles, in their order.
typedef struct {
  float8 low;   // h, h dx, h t, h dx^2, h dx t, h t^2, w dcolour's red and green
  float2 high;  // w dcolour's blue, w ddepth
  bool seen;    // whether any pixel saw the Gaussian
} RowSums;

static inline RowSums sum_rows(global const float* rows, global const uchar* touched, uint begin, uint end) {
  RowSums sum;
  sum.low = 0.0f;
  sum.high = 0.0f;
  sum.seen = false;
  for (uint r = begin; r < end; ++r) {
    if (!touched[r]) continue;
    sum.low += vload8(0, rows + (size_t)r * COLUMNS);
    sum.high += vload2(0, rows + (size_t)r * COLUMNS + 8);
    sum.seen = true;
  }
  return sum;
}

// With p = covariance^-1 (place - pixel), which is linear in dx and t: the sums of h p and of h p p^T. The loss's
// derivative by the place in the picture is the first, negated; that by the covariance is half of the second.
typedef struct {
  float x, y, xx, xy, yy;
} Ellipse;

static inline Ellipse ellipse_sums(float4 form, float8 low) {
  const float k = form.y, X = -2.0f * LN2 * form.z, Y = -2.0f * LN2 * form.w;
  Ellipse p;
  p.y = Y * low.s2;
  p.x = X * low.s1 - k * p.y;
  p.yy = Y * Y * low.s5;
  p.xy = X * Y * low.s4 - k * p.yy;
  p.xx = X * X * low.s3 - k * (X * Y * low.s4 + p.xy);
  return p;
}

// Values that the forward computed for a Gaussian, with its names.
typedef struct {
  float3 W0, W1, W2;  // rows of the rotation world to camera
  float3 d;           // the mean seen from the camera's centre, in the world
  float fx, fy, z, rz, xz, yz, sx, sy;
  float3 j1, j2;      // rows of J W
  float4 q;           // the normalised quaternion
  float q1;           // one over its original length
  float3 r0, r1, r2;  // columns of its rotation
  float3 a1, a2;      // rows of J W R
} Seen;

static inline Seen seen_from(global const float* camera, float3 mean, float4 quat) {
  Seen f;
  f.W0 = vload3(0, camera), f.W1 = vload3(1, camera), f.W2 = vload3(2, camera);
  f.d = (mean - vload3(3, camera)) - vload3(4, camera);
  f.fx = camera[15], f.fy = camera[16];
  f.z = dot(f.W2, f.d);
  f.rz = 1.0f / f.z;
  f.xz = dot(f.W0, f.d) * f.rz, f.yz = dot(f.W1, f.d) * f.rz;
  f.sx = clamp(f.xz, -camera[19], camera[19]), f.sy = clamp(f.yz, -camera[20], camera[20]);
  f.j1 = f.fx * f.rz * (f.W0 - f.sx * f.W2), f.j2 = f.fy * f.rz * (f.W1 - f.sy * f.W2);
  const float q2 = dot(quat, quat);
  f.q1 = q2 > 0.0f ? rsqrt(q2) : 0.0f;
  const float4 q = quat * f.q1;
  f.q = q;
  f.r0 =
      (float3)(1.0f - 2.0f * (q.z * q.z + q.w * q.w), 2.0f * (q.y * q.z + q.x * q.w), 2.0f * (q.y * q.w - q.x * q.z));
  f.r1 =
      (float3)(2.0f * (q.y * q.z - q.x * q.w), 1.0f - 2.0f * (q.y * q.y + q.w * q.w), 2.0f * (q.z * q.w + q.x * q.y));
  f.r2 =
      (float3)(2.0f * (q.y * q.w + q.x * q.z), 2.0f * (q.z * q.w - q.x * q.y), 1.0f - 2.0f * (q.y * q.y + q.z * q.z));
  f.a1 = (float3)(dot(f.j1, f.r0), dot(f.j1, f.r1), dot(f.j1, f.r2));
  f.a2 = (float3)(dot(f.j2, f.r0), dot(f.j2, f.r1), dot(f.j2, f.r2));
  return f;
}

// Gradients by the rows of J W.
typedef struct {
  float3 j1, j2;
} Jacobian;

// From the gradient by the columns of the rotation to that by the quaternion of Gaussian i, which is added to.
static inline void columns_backward(Seen f, float3 c0, float3 c1, float3 c2, size_t i, global float* dquats) {
  const float4 by_q = rotation_backward(f.q, c0, c1, c2);
  vstore4(vload4(i, dquats) + f.q1 * (by_q - dot(by_q, f.q) * f.q), i, dquats);
}

// Gradients through the factor of the opacity: by the scales, by an = jn R with the cross product jn of j, and by j.
// Not used without ANTIALIAS.
typedef struct {
#ifdef ANTIALIAS
  float3 by_scale, by_an, jn;
#endif
  Jacobian by;
} Fading;

#ifdef ANTIALIAS
// Through the factor of the opacity, by whose logarithm the gradient is h. Its square is D / det, where D = |sn|^2 with
// sn = s1 x s2, and det = D + 0.3 (|s1|^2 + |s2|^2) + 0.09, so that its logarithm changes by
//   (1 / D - 1 / det) sn . dsn - 0.3 / det (s1 . ds1 + s2 . ds2).
// The second term is one of the covariance and changes `p`. Nothing in the first one, which is returned, cancels for
// needles and discs. D is not near 0 where a Gaussian is seen.
static inline Fading fading_backward(Seen f, float h, float3 s, Ellipse* p) {
  const float3 s1 = f.a1 * s, s2 = f.a2 * s, pairs = s.yxx * s.zzy;
  const float3 jn = f.fx * f.rz * (f.fy * f.rz) * (f.sx * f.W0 + f.sy * f.W1 + f.W2);  // j1 x j2
  const float3 an = (float3)(dot(jn, f.r0), dot(jn, f.r1), dot(jn, f.r2)), sn = an * pairs;
  const float D = dot(sn, sn), more = DILATION * (dot(s1, s1) + dot(s2, s2)) + DILATION * DILATION, det = D + more;
  p->xx -= DILATION * h / det;
  p->yy -= DILATION * h / det;
  const float3 by_sn = h * (more / det) / D * sn, by_pairs = by_sn * an, by_an = by_sn * pairs;
  const float3 by_jn = by_an.x * f.r0 + by_an.y * f.r1 + by_an.z * f.r2;
  Fading out;
  out.by_scale = by_pairs.yxx * s.zzy + by_pairs.zzy * s.yxx;
  out.by_an = by_an;
  out.jn = jn;
  out.by.j1 = cross(f.j2, by_jn);
  out.by.j2 = cross(by_jn, f.j1);
  return out;
}
#endif

// Through the covariance, which is s1 s1, s1 s2, s2 s2 of s1 = a1 s, s2 = a2 s, with a = j R: adds to the gradients of
// scale and quaternion of Gaussian i, and returns those by j = J W. `fading`: what else is added, in the same rounding.
static inline Jacobian covariance_backward(Seen f, Ellipse p, float3 s, Fading fading, size_t i, global float* dscales,
                                           global float* dquats) {
  const float3 by_s1 = (p.xx * f.a1 + p.xy * f.a2) * s, by_s2 = (p.xy * f.a1 + p.yy * f.a2) * s;
  const float3 by_a1 = by_s1 * s, by_a2 = by_s2 * s;
  float3 by_scale = by_s1 * f.a1 + by_s2 * f.a2;
  float3 c0 = by_a1.x * f.j1 + by_a2.x * f.j2, c1 = by_a1.y * f.j1 + by_a2.y * f.j2;
  float3 c2 = by_a1.z * f.j1 + by_a2.z * f.j2;
  Jacobian by;
  by.j1 = by_a1.x * f.r0 + by_a1.y * f.r1 + by_a1.z * f.r2;
  by.j2 = by_a2.x * f.r0 + by_a2.y * f.r1 + by_a2.z * f.r2;
#ifdef ANTIALIAS
  by_scale += fading.by_scale;
  c0 += fading.by_an.x * fading.jn;
  c1 += fading.by_an.y * fading.jn;
  c2 += fading.by_an.z * fading.jn;
  by.j1 += fading.by.j1;
  by.j2 += fading.by.j2;
#endif
  add3(by_scale, i, dscales);
  columns_backward(f, c0, c1, c2, i, dquats);
  return by;
}

// The gradient by the place in the camera: through u, v, z and the Jacobian. by_z: through the depth that is drawn.
static inline float3 place_backward(Seen f, Ellipse p, Jacobian by, float by_z) {
  const float by_sx = -f.fx * f.rz * dot(by.j1, f.W2), by_sy = -f.fy * f.rz * dot(by.j2, f.W2);
  const float by_xz = -f.fx * p.x + (f.sx == f.xz ? by_sx : 0.0f), by_yz = -f.fy * p.y + (f.sy == f.yz ? by_sy : 0.0f);
  return (float3)(by_xz, by_yz, by_z * f.z - dot(by.j1, f.j1) - dot(by.j2, f.j2) - by_xz * f.xz - by_yz * f.yz) * f.rz;
}

// The gradient by the camera's pose. A turn moves the place and turns J W. A shift by tau moves the place and, by -W^T
// tau, the camera's centre, which colours are seen from.
static inline void pose_backward(Seen f, float3 by_place, Jacobian by, float3 by_from, int mirrored,
                                 global float* dpose) {
  const float3 place = (float3)(dot(f.W0, f.d), dot(f.W1, f.d), f.z);
  const float3 c1 = (float3)(dot(f.W0, by.j1), dot(f.W1, by.j1), dot(f.W2, by.j1));
  const float3 c2 = (float3)(dot(f.W0, by.j2), dot(f.W1, by.j2), dot(f.W2, by.j2));
  const float3 J1 = f.fx * f.rz * (float3)(1.0f, 0.0f, -f.sx), J2 = f.fy * f.rz * (float3)(0.0f, 1.0f, -f.sy);
  const float3 by_centre =
      (mirrored ? -1.0f : 1.0f) * (float3)(dot(f.W0, by_from), dot(f.W1, by_from), dot(f.W2, by_from));
  vstore3(cross(place, by_place) + cross(c1, J1) + cross(c2, J2), 0, dpose);
  vstore3(by_place + by_centre, 0, dpose + 3);
}

kernel MORE_REGISTERS void project_backward(global const float* means, global const float* scales,
                                            global const float* quats, global const float* opacities,
                                            global const float* sh, global const float* views, int view, int mirrored,
                                            global const uint* ids, global const float* records,
                                            global const float* rows, global const uchar* touched,
                                            global const uint* offsets, global float* dmeans, global float* dscales,
                                            global float* dquats, global float* dopacities, global float* dsh,
                                            global float* dpose, int N, int K, int base, int S) {
  const int n = get_global_id(0);
  if (n >= N || ids[n] < (uint)base || ids[n] - (uint)base >= (uint)K) return;
  const RowSums sum = sum_rows(rows, touched, offsets[n], offsets[n + 1]);
  if (dpose)
    for (int c = 0; c < 6; ++c) dpose[(size_t)n * 6 + c] = 0.0f;
  if (!sum.seen) return;

  const size_t i = ids[n] - base;
  dopacities[i] += sum.low.s0 / opacities[i];

  global const float* camera = views + (size_t)view * 32;
  const float3 mean = vload3(i, means);
  Ellipse p = ellipse_sums(vload4(1, records + (size_t)n * 12), sum.low);
  const Seen f = seen_from(camera, mean, vload4(i, quats));
#ifdef ANTIALIAS
  const Fading fading = fading_backward(f, sum.low.s0, vload3(i, scales), &p);
#else
  Fading fading;  // not used
#endif
  const Jacobian by = covariance_backward(f, p, vload3(i, scales), fading, i, dscales, dquats);
  const float3 by_place = place_backward(f, p, by, sum.high.y);
  const float3 by_mean = by_place.x * f.W0 + by_place.y * f.W1 + by_place.z * f.W2;

  const float4 tint = vload4(2, records + (size_t)n * 12);
  const float3 by_colour =
      (float3)(tint.x > 0.0f ? sum.low.s6 : 0.0f, tint.y > 0.0f ? sum.low.s7 : 0.0f, tint.z > 0.0f ? sum.high.x : 0.0f);
  const float3 by_from = colour_backward(camera, mean, sh + i * S * 3, dsh + i * S * 3, S, by_colour);
  add3(by_mean + by_from, i, dmeans);
  if (dpose) pose_backward(f, by_place, by, by_from, mirrored, dpose + (size_t)n * 6);
}

// The gradient by the pose: sums over visible Gaussians, in order, so that they are the same every time.
// ```
// argument    type  shape       what
// dpose       f32   [N,6]       from project_backward
// sums        f32   [blocks,6]  written: sums over `block` Gaussians each, blocks = ceil(N / block)
// work-items  one per number of sums
// ```
kernel void project_backward_pose(global const float* dpose, global float* sums, int N, int block, int blocks) {
  const int at = get_global_id(0);
  if (at >= blocks * 6) return;
  const int b = at / 6, c = at % 6, end = min(N, (b + 1) * block);
  float sum = 0.0f;
  for (int n = b * block; n < end; ++n) sum += dpose[(size_t)n * 6 + c];
  sums[at] = sum;
}

// The magnitude of the loss's derivatives by each Gaussian's place on the screen: the sums over its tiles, in order.
// ```
// argument    type  shape  what
// ids         u32   [N]    the visible Gaussians, as indices into the scene
// rows        f32   [M,2]  of the intersections, as rasterize_backward.cl writes them with PULL
// touched     u8    [M]    whether a row was written
// offsets     u32   [N+1]  visible Gaussian i has the rows offsets[i] .. offsets[i + 1] - 1
// pulls       f32   [K,2]  added to: times by_u, times by_v
// work-items  one per visible Gaussian
// ```
kernel void project_backward_pulls(global const uint* ids, global const float* rows, global const uchar* touched,
                                   global const uint* offsets, global float* pulls, int N, float by_u, float by_v) {
  const int n = get_global_id(0);
  if (n >= N) return;
  float2 sum = 0.0f;
  for (uint r = offsets[n]; r < offsets[n + 1]; ++r)
    if (touched[r]) sum += vload2(r, rows);
  vstore2(vload2(ids[n], pulls) + sum * (float2)(by_u, by_v), ids[n], pulls);
}

// ```
// argument    type  shape  what
// lengths     f32   [K]    written: of the pairs
// work-items  one per pair
// ```
kernel void project_backward_pull_lengths(global const float* pulls, global float* lengths, int K) {
  const int k = get_global_id(0);
  if (k < K) lengths[k] = length(vload2(k, pulls));
}
