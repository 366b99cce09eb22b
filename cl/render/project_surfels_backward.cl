// Projection of surfels (project_surfels.cl) differentiated: from the rows of rasterize_surfels_backward.cl to
// gradients of the surfels and of the camera's pose.
// ```
// argument         type  shape   what
// means .. view                  as in project_surfels.cl: a chunk of a larger scene, whose surfel `base` comes first
// mirrored         int           whether colours are seen from the camera's mirror image
// current          int           as in project_surfels.cl
// ids, touched, offsets          as in project_backward.cl
// records          f32   [N,20]  of the visible surfels, as project_surfels.cl writes them
// rows             f32   [M,20]  of the intersections, as rasterize_surfels_backward.cl writes them
// dscales          f32   [K,2]   added to
// dmeans .. dpose                as in project_backward.cl
// work-items       one per visible surfel
// ```
// As in the forward, these count as constant: tiles, culling, the normal's side, and a colour clamped to 0.
#include "many_registers.clh"
#include "project_backward.clh"

#define COLUMNS 20

// The sums of a surfel's rows over its tiles, in their order.
typedef struct {
  float16 low;
  float4 normal;
  bool seen;  // whether any pixel saw the surfel
} RowSums;

static inline RowSums sum_rows(global const float* rows, global const uchar* touched, uint begin, uint end) {
  RowSums sum;
  sum.low = 0.0f;
  sum.normal = 0.0f;
  sum.seen = false;
  for (uint r = begin; r < end; ++r) {
    if (!touched[r]) continue;
    sum.low += vload16(0, rows + (size_t)r * COLUMNS);
    sum.normal += vload4(4, rows + (size_t)r * COLUMNS);
    sum.seen = true;
  }
  return sum;
}

// Values that the forward computed for a surfel, with its names, in the camera's axes.
typedef struct {
  float3 p, tu, tv, n;
  float2 s;
  float fx, fy, rz, xz, yz;
  float rn;           // 1 / N
  float4 q;           // the normalised quaternion
  float q1;           // one over its original length
  float3 W0, W1, W2;  // rows of the rotation world to camera
} Seen;

// By rows W of the rotation, and back.
#define TURNED(W0, W1, W2, a) ((float3)(dot(W0, a), dot(W1, a), dot(W2, a)))
#define TURNED_BACK(W0, W1, W2, a) ((a).x * (W0) + (a).y * (W1) + (a).z * (W2))

// g: as the record has it. Of a surfel that is seen edge on, N is what rounding leaves, here another number than there,
// or 0: then it is that of the record.
static inline Seen seen_from(global const float* camera, float3 mean, float2 scale, float4 quat, float2 g) {
  const float3 W0 = vload3(0, camera), W1 = vload3(1, camera), W2 = vload3(2, camera);
  const float3 d = (mean - vload3(3, camera)) - vload3(4, camera);
  const float q2 = dot(quat, quat), q1 = q2 > 0.0f ? rsqrt(q2) : 0.0f;
  const float4 q = quat * q1;
  const float3 c0 =
      (float3)(1.0f - 2.0f * (q.z * q.z + q.w * q.w), 2.0f * (q.y * q.z + q.x * q.w), 2.0f * (q.y * q.w - q.x * q.z));
  const float3 c1 =
      (float3)(2.0f * (q.y * q.z - q.x * q.w), 1.0f - 2.0f * (q.y * q.y + q.w * q.w), 2.0f * (q.z * q.w + q.x * q.y));
  const float3 c2 =
      (float3)(2.0f * (q.y * q.w + q.x * q.z), 2.0f * (q.z * q.w - q.x * q.y), 1.0f - 2.0f * (q.y * q.y + q.z * q.z));
  Seen f;
  f.W0 = W0, f.W1 = W1, f.W2 = W2;
  f.p = TURNED(W0, W1, W2, d);
  f.tu = TURNED(W0, W1, W2, c0), f.tv = TURNED(W0, W1, W2, c1), f.n = TURNED(W0, W1, W2, c2);
  f.s = scale;
  f.fx = camera[15], f.fy = camera[16];
  f.rz = 1.0f / f.p.z;
  f.xz = f.p.x * f.rz, f.yz = f.p.y * f.rz;
  const float N = f.n.x * f.xz + f.n.y * f.yz + f.n.z;
  f.rn = fabs(N) > 1e-4f ? 1.0f / N : -dot(g * (float2)(f.fx, f.fy), f.n.xy) / dot(f.n.xy, f.n.xy);
  f.q = q;
  f.q1 = q1;
  return f;
}

// Gradients, in the camera's axes.
typedef struct {
  float3 p, tu, tv, n;
  float2 s;
  float xz, yz;  // by p.x / p.z and p.y / p.z, where that is not by p
} By;

// Through m11 .. m22 and g1, g2. by: the sums for these six.
static inline void plane_backward(Seen f, float4 m, float2 g, float4 by_m, float2 by_g, By* by) {
  // m11 = iu / fx (yz tv.z - tv.y), m12 = iu / fy (tv.x - xz tv.z), m21 = iv / fx (tu.y - yz tu.z), m22 = iv / fy (xz
  // tu.z - tu.x), iu = p.z / (s_u N), iv = p.z / (s_v N); g = -(n.x / fx, n.y / fy) / N.
  const float rn = f.rn, iu = f.p.z * rn / f.s.x, iv = f.p.z * rn / f.s.y;
  const float c11 = by_m.x * iu / f.fx, c12 = by_m.y * iu / f.fy, c21 = by_m.z * iv / f.fx, c22 = by_m.w * iv / f.fy;
  by->tv += (float3)(c12, -c11, c11 * f.yz - c12 * f.xz);
  by->tu += (float3)(-c22, c21, c22 * f.xz - c21 * f.yz);
  by->yz += c11 * f.tv.z - c21 * f.tu.z;
  by->xz += c22 * f.tu.z - c12 * f.tv.z;
  const float by_iu = dot(by_m.xy, m.xy), by_iv = dot(by_m.zw, m.zw);  // times iu, iv
  by->s -= (float2)(by_iu, by_iv) / f.s;
  by->p.z += (by_iu + by_iv) * f.rz;
  by->n.xy -= by_g * rn / (float2)(f.fx, f.fy);
  const float by_N = -(by_iu + by_iv + dot(by_g, g)) * rn;
  by->n += by_N * (float3)(f.xz, f.yz, 1.0f);
  by->xz += by_N * f.n.x;
  by->yz += by_N * f.n.y;
}

// Through the middle of the box: e = f (a . w), f = cut2 / (cut2 w . w - z^2), with the rows a1, a2 of A.
static inline void box_backward(Seen f, float cut2, float2 by_e, By* by) {
  const float2 w = f.s * (float2)(f.tu.z, f.tv.z);
  const float2 a1 = f.fx * f.s * (float2)(f.tu.x - f.xz * f.tu.z, f.tv.x - f.xz * f.tv.z);
  const float2 a2 = f.fy * f.s * (float2)(f.tu.y - f.yz * f.tu.z, f.tv.y - f.yz * f.tv.z);
  const float k = cut2 / (cut2 * dot(w, w) - f.p.z * f.p.z);
  const float by_k = by_e.x * dot(a1, w) + by_e.y * dot(a2, w), by_d = -by_k * k * k / cut2;
  const float2 by_a1 = by_e.x * k * w, by_a2 = by_e.y * k * w;
  const float2 by_w = k * (by_e.x * a1 + by_e.y * a2) + 2.0f * cut2 * by_d * w;
  by->p.z -= 2.0f * by_d * f.p.z;
  const float2 tz = (float2)(f.tu.z, f.tv.z);
  by->s += by_w * tz + (by_a1 * a1 + by_a2 * a2) / f.s;
  const float2 c1 = f.fx * f.s * by_a1, c2 = f.fy * f.s * by_a2;
  const float2 by_tz = by_w * f.s - c1 * f.xz - c2 * f.yz;
  by->tu += (float3)(c1.x, c2.x, by_tz.x);
  by->tv += (float3)(c1.y, c2.y, by_tz.y);
  by->xz -= dot(c1, tz);
  by->yz -= dot(c2, tz);
}

kernel MORE_REGISTERS void project_surfels_backward(
    global const float* means, global const float* scales, global const float* quats, global const float* opacities,
    global const float* sh, global const float* views, int view, int mirrored, int current, global const uint* ids,
    global const float* records, global const float* rows, global const uchar* touched, global const uint* offsets,
    global float* dmeans, global float* dscales, global float* dquats, global float* dopacities, global float* dsh,
    global float* dpose, int N, int K, int base, int S) {
  const int at = get_global_id(0);
  if (at >= N || ids[at] < (uint)base || ids[at] - (uint)base >= (uint)K) return;
  const RowSums sum = sum_rows(rows, touched, offsets[at], offsets[at + 1]);
  if (dpose)
    for (int c = 0; c < 6; ++c) dpose[(size_t)at * 6 + c] = 0.0f;
  if (!sum.seen) return;

  const size_t i = ids[at] - base;
  dopacities[i] += sum.low.s0 / opacities[i];

  global const float* camera = views + (size_t)view * 32;
  global const float* record = records + (size_t)at * 20;
  const float4 m = vload4(1, record), box = vload4(2, record), tint = vload4(3, record), facing = vload4(4, record);
  const float3 mean = vload3(i, means);
  const Seen f = seen_from(camera, mean, vload2(i, scales), vload4(i, quats), box.xy);
  By by = {(float3)(0.0f), (float3)(0.0f), (float3)(0.0f), (float3)(0.0f), (float2)(0.0f), 0.0f, 0.0f};
  plane_backward(f, m, box.xy, sum.low.s4567, sum.low.s89, &by);
  box_backward(f, current ? 9.0f : 1.0f, sum.low.sab, &by);
  // Through u and v, which move dx and dy; the low pass' distance, too.
  by.xz += f.fx * (m.x * sum.low.s1 + m.z * sum.low.s2 + box.x * sum.low.s3 + sum.low.sa);
  by.yz += f.fy * (m.y * sum.low.s1 + m.w * sum.low.s2 + box.y * sum.low.s3 + sum.low.sb);
  by.n += (dot(facing.xyz, f.n) > 0.0f ? 1.0f : -1.0f) * sum.normal.xyz;
  const float3 by_place =
      by.p + (float3)(by.xz * f.rz, by.yz * f.rz, sum.low.sc - (by.xz * f.xz + by.yz * f.yz) * f.rz);

  const float4 by_q = rotation_backward(f.q, TURNED_BACK(f.W0, f.W1, f.W2, by.tu), TURNED_BACK(f.W0, f.W1, f.W2, by.tv),
                                        TURNED_BACK(f.W0, f.W1, f.W2, by.n));
  vstore4(vload4(i, dquats) + f.q1 * (by_q - dot(by_q, f.q) * f.q), i, dquats);
  vstore2(vload2(i, dscales) + by.s, i, dscales);
  const float3 by_colour =
      (float3)(tint.x > 0.0f ? sum.low.sd : 0.0f, tint.y > 0.0f ? sum.low.se : 0.0f, tint.z > 0.0f ? sum.low.sf : 0.0f);
  const float3 by_from = colour_backward(camera, mean, sh + i * S * 3, dsh + i * S * 3, S, by_colour);
  add3(TURNED_BACK(f.W0, f.W1, f.W2, by_place) + by_from, i, dmeans);
  if (!dpose) return;
  // A turn moves place and axes. A shift by tau moves the place and, by -W^T tau, the camera's centre, which colours
  // are seen from.
  vstore3(cross(f.p, by_place) + cross(f.tu, by.tu) + cross(f.tv, by.tv) + cross(f.n, by.n), 0, dpose + (size_t)at * 6);
  vstore3(by_place + (mirrored ? -1.0f : 1.0f) * TURNED(f.W0, f.W1, f.W2, by_from), 0, dpose + (size_t)at * 6 + 3);
}
