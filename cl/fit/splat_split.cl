// Splits the Gaussians that cover the picture's errors: their scores, and the split along the longest axis. A
// Gaussian's score in a picture is the sum over pixels of its blending weight times the pixel's error. What is split
// becomes two Gaussians that are together as opaque in the middle: opacity' = 1 - sqrt(1 - opacity), their means OFFSET
// deviations to either side along the longest axis, along which the deviation is multiplied by SHRINK.
// ```
// argument    type  shape  what
// logits      f32   [K]    opacity = sigmoid(logit)
// log_scales  f32   [K,3]  scale = exp(log scale)
// quats       f32   [K,4]  of any length but 0
// ```
#include "rasterize.clh"

#define LEAST 0.005f  // opacity below which a Gaussian's place is used for another
#define OFFSET 0.5f
#define SHRINK 0.866025404f  // sqrt(1 - OFFSET^2): the variance along the axis stays

// A picture's error: the mean absolute difference over channels.
// ```
// argument    type  shape  what
// colour      f32   [P,3]  drawn
// target      f32   [P,3]  in [0, 1]
// error       f32   [P]    written; the drawn colour is clamped to [0, 1] first
// work-items  one per pixel
// ```
kernel void splat_split_error(global const float* restrict colour, global const float* restrict target,
                              global float* restrict error, int P) {
  const int i = get_global_id(0);
  if (i >= P) return;
  const float3 off = fabs(clamp(vload3(i, colour), 0.0f, 1.0f) - vload3(i, target));
  error[i] = (off.x + off.y + off.z) * (1.0f / 3.0f);
}

// Takes the last column out of the rows of a backward pass: the sums over tiles, in order.
// ```
// argument    type   shape   what
// ids         u32    [N]     the visible Gaussians, as indices into the scene
// touched     u8     [M]     whether a row was written
// offsets     u32    [N+1]   visible Gaussian i has the rows offsets[i] .. offsets[i + 1] - 1
// records     f32    [N,12]  the visible Gaussians, as project.cl writes them
// rows        f32    [M,10]  as rasterize_backward.cl writes them with WEIGH; the last column becomes 0
// scores      f32    [K]     added to: the sum, or 1e30 for a Gaussian that covers more than `most` pixels
// work-items  one per visible Gaussian
// ```
// A Gaussian covers at most the tiles that see it, and the ellipse where its alpha reaches MIN_ALPHA.
kernel void splat_split_scores(global const uint* restrict ids, global const uchar* restrict touched,
                               global const uint* restrict offsets, global const float* restrict records,
                               global float* restrict rows, global float* restrict scores, int N, float most) {
  const int n = get_global_id(0);
  if (n >= N) return;
  float sum = 0.0f;
  uint tiles = 0;
  for (uint r = offsets[n]; r < offsets[n + 1]; ++r) {
    if (!touched[r]) continue;
    sum += rows[(size_t)r * 10 + 9];
    rows[(size_t)r * 10 + 9] = 0.0f;
    ++tiles;
  }
  const float4 form = vload4(1, records + (size_t)n * 12);
  const float ellipse = M_PI_F * (form.x + LOG2_255) * rsqrt(form.z * form.w);
  const float covered = fmin(ellipse, (float)tiles * (TILE * TILE));
  scores[ids[n]] += covered > most ? 1e30f : sum;
}

// ```
// argument    type  shape  what
// fresh       f32   [K]    one picture's scores
// scores      f32   [K]    added to
// work-items  one per Gaussian
// ```
kernel void splat_split_add(global const float* restrict fresh, global float* restrict scores, int K) {
  const int k = get_global_id(0);
  if (k < K) scores[k] += fresh[k];
}

// ```
// argument    type  shape  what
// scores      f32   [K]    summed over pictures
// ranks       f32   [K]    written: the score; -1 for a Gaussian whose place is free
// free        u32   [K]    written: 1 where the place is free
// work-items  one per Gaussian
// ```
kernel void splat_split_rank(global const float* restrict logits, global const float* restrict scores,
                             global float* restrict ranks, global uint* restrict free, int K) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const bool stays = sigmoid(logits[k]) >= LEAST;  // false for NaN, too
  ranks[k] = stays ? (scores[k] > 0.0f ? scores[k] : 0.0f) : -1.0f;
  free[k] = stays ? 0u : 1u;
}

static inline uint place_of(global const int* slots, uint j, int K, int free) {
  return j < (uint)free ? (uint)slots[j] : (uint)K + j - (uint)free;
}

// Each source stays where it is as one half; the other half goes to the j-th free place, or behind the last Gaussian.
// ```
// argument     type  shape     what
// sources      i32   [splits]  which Gaussians are split, ascending
// slots        i32   [free]    free places, ascending
// means ...    f32   [K+..]    parameters, of which those of both halves are written
// work-items   one per source
// ```
kernel void splat_split(global const int* restrict sources, global const int* restrict slots,
                        global float* restrict means, global float* restrict log_scales,
                        global const float* restrict quats, global float* restrict logits, int K, int free,
                        int splits) {
  const int j = get_global_id(0);
  if (j >= splits) return;
  const uint k = sources[j], to = place_of(slots, j, K, free);
  const float3 s = vload3(k, log_scales);
  const float4 raw = vload4(k, quats), q = raw * rsqrt(dot(raw, raw));
  const float w = q.x, x = q.y, y = q.z, z = q.w;
  const int axis = s.x >= s.y && s.x >= s.z ? 0 : s.y >= s.z ? 1 : 2;
  const float3 c0 = (float3)(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y));  // columns
  const float3 c1 = (float3)(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x));
  const float3 c2 = (float3)(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));
  const float longest = axis == 0 ? s.x : axis == 1 ? s.y : s.z;
  const float3 step = OFFSET * exp(longest) * (axis == 0 ? c0 : axis == 1 ? c1 : c2);
  const float3 mean = vload3(k, means), shrink = log(SHRINK) * (float3)(axis == 0, axis == 1, axis == 2);
  const float opacity = fmin(sigmoid(logits[k]), 1.0f - 1e-6f);
  const float half_opacity = clamp(-expm1(0.5f * log1p(-opacity)), LEAST, 1.0f - 1e-6f);
  const float logit = log(half_opacity / (1.0f - half_opacity));
  vstore3(mean - step, k, means);
  vstore3(mean + step, to, means);
  vstore3(s + shrink, k, log_scales);
  vstore3(s + shrink, to, log_scales);
  logits[k] = logits[to] = logit;
}

// Parameters that both halves have from the source, `width` numbers a Gaussian; and moments, which begin again.
// ```
// argument    type  shape        what
// x           f32   [K+.,width]  the other half's rows are written; null: none
// m, v        f32   [K+.,width]  both halves' rows become 0
// work-items  (number, source)
// ```
kernel void splat_split_copy(global const int* restrict sources, global const int* restrict slots,
                             global float* restrict x, global float* restrict m, global float* restrict v, int K,
                             int free, int width) {
  const int i = get_global_id(0), j = get_global_id(1);
  if (i >= width) return;
  const size_t from = (size_t)sources[j] * width + i, to = (size_t)place_of(slots, j, K, free) * width + i;
  if (x) x[to] = x[from];
  m[from] = v[from] = m[to] = v[to] = 0.0f;
}
