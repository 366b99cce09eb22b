// Decodes the heads' raw numbers to Gaussians in the object's frame.
//   mean    = anchor + (2 sigmoid(offset) - 1) reach      opacity = sigmoid(x - 2.1792)
//   scale   = softplus(x + scale_shift)                   quat    = x / max(|x|, 1e-12)
//             or exp(x + scale_shift)
// The spherical harmonics (SH, S coefficients x 3 colours) are taken as they are.
// ```
// argument     type   shape    what
// raw          f32    [..,A]   a Gaussian's A = 8 + 3S + D numbers: offset 3, SH 3S, opacity 1, scale D, rotation 4
// means        f32    [K,3]    written
// scales       f32    [K,D]    written; D = 3, or 2 of surfels
// quats        f32    [K,4]    written: w x y z, of length 1
// opacities    f32    [K]      written
// sh           f32    [K,S,3]  written
// sh_size      int             3S
// reach        float           largest distance of a mean from its anchor along each axis
// scale_shift  float           offset of raw scales
// exponential  int             0: softplus, else exp
// work-items   one per Gaussian, in all kernels
// ```
#include "common.clh"

#define OPACITY_SHIFT (-2.1792f)

static inline float softplus(float x) { return fmax(x, 0.0f) + log1p(exp(-fabs(x))); }

// Decodes a Gaussian's appearance, from the numbers after its offset, into row k.
static inline void decode_looks(global const float* raw, float scale_shift, int sh_size, int D, int exponential, long k,
                                global float* scales, global float* quats, global float* opacities, global float* sh) {
  for (int i = 0; i < sh_size; ++i) sh[k * sh_size + i] = raw[i];
  raw += sh_size;
  opacities[k] = sigmoid(raw[0] + OPACITY_SHIFT);
  for (int i = 0; i < D; ++i) {
    const float x = raw[1 + i] + scale_shift;
    scales[D * k + i] = exponential ? exp(x) : softplus(x);
  }
  const float4 q = vload4(0, raw + 1 + D);
  // The largest component is divided out first: squares of small or large ones would leave float32's range.
  const float largest = fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.z), fabs(q.w)));
  const float4 unit = q / fmax(largest, 1e-30f);
  const float norm = largest * sqrt(dot(unit, unit));
  vstore4(q / fmax(norm, 1e-12f), k, quats);
}

// One Gaussian, into row k.
static inline void decode(global const float* raw, float3 anchor, float reach, float scale_shift, int sh_size, int D,
                          int exponential, long k, global float* means, global float* scales, global float* quats,
                          global float* opacities, global float* sh) {
  const float3 offset = vload3(0, raw);
  const float3 away = (float3)(sigmoid(offset.x), sigmoid(offset.y), sigmoid(offset.z)) * 2.0f - 1.0f;
  vstore3(anchor + away * reach, k, means);
  decode_looks(raw + 3, scale_shift, sh_size, D, exponential, k, scales, quats, opacities, sh);
}

// `each` Gaussians for each voxel of the R^3 grid, anchored at the voxel's centre. raw [R^3,each A].
kernel void decode_coarse_forward(global const float* restrict raw, global float* restrict means,
                                  global float* restrict scales, global float* restrict quats,
                                  global float* restrict opacities, global float* restrict sh, int R, int each,
                                  int sh_size, int D, int exponential, float reach, float scale_shift) {
  const int k = get_global_id(0);
  if (k >= R * R * R * each) return;
  const int at = k / each;
  const float3 voxel = (float3)((float)(at / (R * R)), (float)(at / R % R), (float)(at % R));
  decode(raw + (long)k * (8 + D + sh_size), (voxel + 0.5f) / (float)R - 0.5f, reach, scale_shift, sh_size, D,
         exponential, k, means, scales, quats, opacities, sh);
}

// M Gaussians for each of P voxels, anchored at the coarse centre plus one of M offsets.
// ```
// argument    type  shape    what
// raw         f32   [P,M A]  M Gaussians side by side
// centres     f32   [P,3]    of the coarse Gaussians
// div_offset  f32   [M,3]    the offsets, learnt
// ```
kernel void decode_fine_forward(global const float* restrict raw, global const float* restrict centres,
                                global const float* restrict div_offset, global float* restrict means,
                                global float* restrict scales, global float* restrict quats,
                                global float* restrict opacities, global float* restrict sh, int P, int M, int sh_size,
                                float reach, float scale_shift) {
  const int k = get_global_id(0);
  if (k >= P * M) return;
  const float3 anchor = vload3(k / M, centres) + vload3(k % M, div_offset);
  decode(raw + (long)k * (11 + sh_size), anchor, reach, scale_shift, sh_size, 3, 0, k, means, scales, quats, opacities,
         sh);
}

// One Gaussian for each of P points, its mean: raw has no offset. Gaussians row0 .. row0 + P - 1 are written.
// ```
// argument    type  shape     what
// raw         f32   [P,A-3]   a Gaussian's numbers without the offset
// points      f32   [P,3]
// ```
kernel void decode_points_forward(global const float* restrict raw, global const float* restrict points,
                                  global float* restrict means, global float* restrict scales,
                                  global float* restrict quats, global float* restrict opacities,
                                  global float* restrict sh, int P, int sh_size, int row0, float scale_shift) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const long k = (long)row0 + p;
  vstore3(vload3(p, points), k, means);
  decode_looks(raw + (long)p * (8 + sh_size), scale_shift, sh_size, 3, 1, k, scales, quats, opacities, sh);
}

// The skeleton's P coarse Gaussians, with new SH and with opacities times sigmoid(factor).
// ```
// argument                  type  shape     what
// raw                       f32   [P,3S+1]  SH, factor
// in_means .. in_opacities  f32   [P,..]    the skeleton's Gaussians
// means .. sh               f32   [K,..]    rows row0 .. row0 + P - 1 are written
// ```
kernel void decode_adjusted_forward(global const float* restrict raw, global const float* restrict in_means,
                                    global const float* restrict in_scales, global const float* restrict in_quats,
                                    global const float* restrict in_opacities, global float* restrict means,
                                    global float* restrict scales, global float* restrict quats,
                                    global float* restrict opacities, global float* restrict sh, int P, int sh_size,
                                    int row0) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const long k = (long)row0 + p;
  raw += (long)p * (sh_size + 1);
  vstore3(vload3(p, in_means), k, means);
  vstore3(vload3(p, in_scales), k, scales);
  vstore4(vload4(p, in_quats), k, quats);
  for (int i = 0; i < sh_size; ++i) sh[k * sh_size + i] = raw[i];
  opacities[k] = sigmoid(raw[sh_size]) * in_opacities[p];
}

// Backward.
// ```
// argument                  type  shape   what
// dmeans .. dsh             f32   [K,..]  gradients of the Gaussians, in the forward's rows
// draw                      f32   as raw  written: the gradient of raw; may not be raw
// dcentres                  f32   [P,3]   of decode_fine: added to, the means' gradients, by a voxel's first work-item
//                                         in order
// to_means .. to_opacities  f32   [P,..]  of decode_adjusted: gradients of the skeleton's Gaussians, added to
// work-items                one per Gaussian, in all kernels
// ```

static inline float sigmoid_slope(float x) { return sigmoid(x) * sigmoid(-x); }

static inline void looks_backward(global const float* raw, float scale_shift, int sh_size, int D, int exponential,
                                  long k, global const float* dscales, global const float* dquats,
                                  global const float* dopacities, global const float* dsh, global float* draw) {
  for (int i = 0; i < sh_size; ++i) draw[i] = dsh[k * sh_size + i];
  raw += sh_size;
  draw += sh_size;
  draw[0] = dopacities[k] * sigmoid_slope(raw[0] + OPACITY_SHIFT);
  for (int i = 0; i < D; ++i) {
    const float x = raw[1 + i] + scale_shift;
    draw[1 + i] = dscales[D * k + i] * (exponential ? exp(x) : sigmoid(x));
  }
  raw += 1 + D;
  draw += 1 + D;
  const float4 q = vload4(0, raw), d = vload4(k, dquats);
  const float largest = fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.z), fabs(q.w)));
  const float4 scaled = q / fmax(largest, 1e-30f);
  const float length = sqrt(dot(scaled, scaled)), norm = largest * length;
  if (norm >= 1e-12f) {
    const float4 unit = scaled / length;
    vstore4((d - unit * dot(unit, d)) / norm, 0, draw);
  } else {
    vstore4(d / 1e-12f, 0, draw);  // divided by a constant, as F.normalize does
  }
}

static inline void decode_backward(global const float* raw, float reach, float scale_shift, int sh_size, int D,
                                   int exponential, long k, global const float* dmeans, global const float* dscales,
                                   global const float* dquats, global const float* dopacities, global const float* dsh,
                                   global float* draw) {
  for (int i = 0; i < 3; ++i) draw[i] = dmeans[3 * k + i] * 2.0f * reach * sigmoid_slope(raw[i]);
  looks_backward(raw + 3, scale_shift, sh_size, D, exponential, k, dscales, dquats, dopacities, dsh, draw + 3);
}

kernel void decode_coarse_backward(global const float* restrict raw, global const float* restrict dmeans,
                                   global const float* restrict dscales, global const float* restrict dquats,
                                   global const float* restrict dopacities, global const float* restrict dsh,
                                   global float* restrict draw, int R, int each, int sh_size, int D, int exponential,
                                   float reach, float scale_shift) {
  const int k = get_global_id(0);
  if (k >= R * R * R * each) return;
  const long row = (long)k * (8 + D + sh_size);
  decode_backward(raw + row, reach, scale_shift, sh_size, D, exponential, k, dmeans, dscales, dquats, dopacities, dsh,
                  draw + row);
}

kernel void decode_fine_backward(global const float* restrict raw, global const float* restrict dmeans,
                                 global const float* restrict dscales, global const float* restrict dquats,
                                 global const float* restrict dopacities, global const float* restrict dsh,
                                 global float* restrict draw, global float* restrict dcentres, int P, int M,
                                 int sh_size, float reach, float scale_shift) {
  const int k = get_global_id(0);
  if (k >= P * M) return;
  const long row = (long)k * (11 + sh_size);
  decode_backward(raw + row, reach, scale_shift, sh_size, 3, 0, k, dmeans, dscales, dquats, dopacities, dsh,
                  draw + row);
  if (k % M) return;
  float3 sum = vload3(k, dmeans);
  for (int m = 1; m < M; ++m) sum += vload3(k + m, dmeans);
  vstore3(vload3(k / M, dcentres) + sum, k / M, dcentres);
}

// The means' gradients, rows row0 .. row0 + P - 1 of them, are the points'.
// ```
// argument    type  shape    what
// dpoints     f32   [P,3]    written
// ```
kernel void decode_points_backward(global const float* restrict raw, global const float* restrict dmeans,
                                   global const float* restrict dscales, global const float* restrict dquats,
                                   global const float* restrict dopacities, global const float* restrict dsh,
                                   global float* restrict draw, global float* restrict dpoints, int P, int sh_size,
                                   int row0, float scale_shift) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const long k = (long)row0 + p, row = (long)p * (8 + sh_size);
  vstore3(vload3(k, dmeans), p, dpoints);
  looks_backward(raw + row, scale_shift, sh_size, 3, 1, k, dscales, dquats, dopacities, dsh, draw + row);
}

kernel void decode_adjusted_backward(global const float* restrict raw, global const float* restrict in_opacities,
                                     global const float* restrict dmeans, global const float* restrict dscales,
                                     global const float* restrict dquats, global const float* restrict dopacities,
                                     global const float* restrict dsh, global float* restrict draw,
                                     global float* restrict to_means, global float* restrict to_scales,
                                     global float* restrict to_quats, global float* restrict to_opacities, int P,
                                     int sh_size, int row0) {
  const int p = get_global_id(0);
  if (p >= P) return;
  const long k = (long)row0 + p;
  raw += (long)p * (sh_size + 1);
  draw += (long)p * (sh_size + 1);
  vstore3(vload3(p, to_means) + vload3(k, dmeans), p, to_means);
  vstore3(vload3(p, to_scales) + vload3(k, dscales), p, to_scales);
  vstore4(vload4(p, to_quats) + vload4(k, dquats), p, to_quats);
  for (int i = 0; i < sh_size; ++i) draw[i] = dsh[k * sh_size + i];
  draw[sh_size] = dopacities[k] * in_opacities[p] * sigmoid_slope(raw[sh_size]);
  to_opacities[p] += dopacities[k] * sigmoid(raw[sh_size]);
}
