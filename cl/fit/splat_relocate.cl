// Moves nearly transparent Gaussians to the places of others, and adds new ones there: 3D Gaussian splatting as Markov
// chain Monte Carlo (Kheradmand et al. 2024). A source that n - 1 others join is replaced by n equal ones that together
// look like it:
//   opacity' = 1 - (1 - opacity)^(1/n)
//   scale'   = scale opacity / sum_{i=1..n} sum_{k=0..i-1} binomial(i-1, k) (-1)^k opacity'^(k+1) / sqrt(k+1)
//
// Sources are drawn in proportion to their opacity, with one random number (systematic resampling): N points at equal
// distances, point j at floor((j W + offset) / N), hit the consecutive weights w, whose sum is W. So both the source of
// a point and the points of a source follow without a sort.
// ```
// argument     type  shape  what
// logits       f32   [K]    opacity = sigmoid(logit)
// log_scales   f32   [K,3]  scale = exp(log scale)
// starts       u32   [K+1]  exclusive scan of the weights, W its last
// N            uint         points: Gaussians that move or are added
// offset       uint         below W
// ```
#include "common.clh"
#include "rng.clh"

#define LEAST 0.005f  // opacity below which a Gaussian moves

// ```
// argument    type  shape  what
// weights     u32   [K]    written: the opacity in steps of 1 / finest, plus 1; 0 if it moves
// moving      u32   [K]    written: 1 where it moves
// finest      uint         such that the sum of weights stays below 2^32
// work-items  one per Gaussian
// ```
kernel void splat_relocate_weigh(global const float* restrict logits, global uint* restrict weights,
                                 global uint* restrict moving, int K, uint finest) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const float opacity = sigmoid(logits[k]);
  const bool stays = opacity >= LEAST;  // false for NaN, too
  weights[k] = stays ? (uint)(opacity * finest) + 1u : 0u;
  moving[k] = stays ? 0u : 1u;
}

// ```
// argument    type  shape     what
// first       u32   [K+1]     exclusive scan of moving
// slots       u32   [moving]  written: which Gaussians move
// work-items  one per Gaussian
// ```
kernel void splat_relocate_slots(global const uint* restrict moving, global const uint* restrict first,
                                 global uint* restrict slots, int K) {
  const int k = get_global_id(0);
  if (k < K && moving[k]) slots[first[k]] = k;
}

// ```
// argument    type  shape  what
// first       u32   [K+1]  exclusive scan of moving
// totals      u32   [2]    written: W, and how many move
// work-items  one
// ```
kernel void splat_relocate_totals(global const uint* restrict starts, global const uint* restrict first,
                                  global uint* restrict totals, int K) {
  totals[0] = starts[K];
  totals[1] = first[K];
}

// Points below x.
static inline uint points_below(ulong x, ulong N, ulong W, uint offset) {
  const ulong reach = x * N;
  if (reach <= offset) return 0u;
  const ulong count = (reach - offset + W - 1) / W;
  return (uint)(count < N ? count : N);
}

static inline uint points_of(global const uint* restrict starts, uint k, uint K, uint N, uint offset) {
  const ulong W = starts[K];
  return points_below(starts[k + 1], N, W, offset) - points_below(starts[k], N, W, offset);
}

// exp(-s^2) for s = 1/8, 2/8, ...
constant float bell[37] = {0.984496415f,    0.939413071f,    0.868815064f,    0.778800786f,    0.676633835f,
                           0.569782853f,    0.465043187f,    0.36787945f,     0.282062948f,    0.209611386f,
                           0.150977418f,    0.105399221f,    0.0713166818f,   0.0467706211f,   0.0297292173f,
                           0.0183156393f,   0.0109367678f,   0.00632971525f,  0.00355064846f,  0.00193045416f,
                           0.00101727783f,  0.000519574678f, 0.000257208128f, 0.000123409802f, 5.73908874e-05f,
                           2.58680993e-05f, 1.13009364e-05f, 4.7851172e-06f,  1.96380824e-06f, 7.81148913e-07f,
                           3.01159758e-07f, 1.12535176e-07f, 4.07575378e-08f, 1.43072416e-08f, 4.86779372e-09f,
                           1.60522806e-09f, 5.13061704e-10f};

// 1 - (1 - x)^n. A sum of few powers is faster than the functions.
static inline float share_of_all(float x, uint n) {
  if (n > 16) return -expm1((float)n * log1p(-x));
  float powers = 1.0f;
  for (uint k = 1; k < n; ++k) powers = FMA(1.0f - x, powers, 1.0f);
  return x * powers;
}

// The opacity of each of n equal Gaussians, and what their scales are multiplied by. The double sum's terms grow beyond
// what float32 can subtract; with 1 / sqrt(k+1) = 2 / sqrt(pi) integral_0^inf exp(-(k+1) s^2) ds it is
//   2 / sqrt(pi) integral_0^inf (1 - (1 - opacity' exp(-s^2))^n) ds
// whose trapezoids are all positive. For the opacities that there are, nothing is left of it beyond 4.75, and a step of
// 1/8 is exact to float32.
static inline float2 shared_between(float opacity, uint n) {
  const float each = -expm1(log1p(-opacity) / (float)n);
  float sum = 0.5f * opacity;
  for (int i = 0; i < 37; ++i) sum += share_of_all(each * bell[i], n);
  return (float2)(each, opacity / (0.125f * 1.128379167f * sum));
}

static inline float logit(float p) {
  const float held = clamp(p, LEAST, 1.0f - 1e-6f);
  return log(held / (1.0f - held));
}

// Writes the n-th part of a source into Gaussian `to`, with zero moments.
static inline void put_share(global float* restrict logits, global float* restrict log_scales,
                             global float* restrict m_logits, global float* restrict v_logits,
                             global float* restrict m_scales, global float* restrict v_scales, float opacity,
                             float3 log_scale, uint n, uint to) {
  const float2 share = shared_between(fmin(opacity, 1.0f - 1e-6f), n);
  logits[to] = logit(share.x);
  vstore3(log_scale + log(share.y), to, log_scales);
  m_logits[to] = v_logits[to] = 0.0f;
  vstore3((float3)(0.0f), to, m_scales);
  vstore3((float3)(0.0f), to, v_scales);
}

// Which source each point hits, and the Gaussian that goes there.
// ```
// argument    type  shape      what
// slots       u32   [moving]   from splat_relocate_slots
// logits ...  f32   [K+new..]  the parameters, of which those of the slots and of K, K + 1, ... are written
// sources     u32   [N]        written: point j's source
// work-items  one per point
// ```
kernel void splat_relocate_move(global const uint* restrict starts, global const uint* restrict slots,
                                global float* restrict logits, global float* restrict log_scales,
                                global float* restrict m_logits, global float* restrict v_logits,
                                global float* restrict m_scales, global float* restrict v_scales,
                                global uint* restrict sources, int K, int moving, uint N, uint offset) {
  const uint j = get_global_id(0);
  if (j >= N) return;
  const ulong W = starts[K];
  const uint point = (uint)(((ulong)j * W + offset) / N);
  uint low = 0, high = K;  // starts[low] <= point < starts[high]
  while (high - low > 1) {
    const uint middle = (low + high) / 2;
    if (starts[middle] <= point)
      low = middle;
    else
      high = middle;
  }
  sources[j] = low;
  const uint to = j < (uint)moving ? slots[j] : K + j - moving;
  put_share(logits, log_scales, m_logits, v_logits, m_scales, v_scales, sigmoid(logits[low]), vload3(low, log_scales),
            points_of(starts, low, K, N, offset) + 1, to);
}

// The other parameters, `width` numbers a Gaussian, with their moments.
// ```
// argument    type  shape          what
// x, m, v     f32   [K+new,width]  rows of the slots and of K, K + 1, ... are written
// work-items  (number, point)
// ```
kernel void splat_relocate_copy(global const uint* restrict sources, global const uint* restrict slots,
                                global float* restrict x, global float* restrict m, global float* restrict v, int K,
                                int moving, uint N, int width) {
  const int i = get_global_id(0), j = get_global_id(1);
  if (i >= width) return;
  const size_t to = ((size_t)(j < moving ? slots[j] : (uint)(K + j - moving))) * width + i;
  x[to] = x[(size_t)sources[j] * width + i];
  m[to] = v[to] = 0.0f;
}

// The sources' own shares, once all points have read them.
// ```
// argument    type  shape  what
// work-items  one per Gaussian that was there before
// ```
kernel void splat_relocate_sources(global const uint* restrict starts, global float* restrict logits,
                                   global float* restrict log_scales, global float* restrict m_logits,
                                   global float* restrict v_logits, global float* restrict m_scales,
                                   global float* restrict v_scales, int K, uint N, uint offset) {
  const int k = get_global_id(0);
  if (k >= K || starts[k + 1] == starts[k]) return;
  const uint n = points_of(starts, k, K, N, offset);
  if (n == 0) return;
  put_share(logits, log_scales, m_logits, v_logits, m_scales, v_scales, sigmoid(logits[k]), vload3(k, log_scales),
            n + 1, k);
}

// Gaussians of which little is seen wander: means += rate sigmoid(100 (0.005 - opacity)) C xi, with the covariance C
// and xi normal.
// ```
// argument       type  shape  what
// means          f32   [K,3]  in place
// quats          f32   [K,4]  of any length but 0
// draw, stream   uint         the counter is {k, draw, stream, 0}
// key0, key1     uint         of the seed
// work-items     one per Gaussian
// ```
kernel void splat_relocate_noise(global float* restrict means, global const float* restrict log_scales,
                                 global const float* restrict quats, global const float* restrict logits, int K,
                                 float rate, uint draw, uint stream, uint key0, uint key1) {
  const int k = get_global_id(0);
  if (k >= K) return;
  const float seen = sigmoid(100.0f * (LEAST - sigmoid(logits[k])));
  if (seen < 1e-6f) return;
  const uint4 bits = philox4x32_10((uint4)(k, draw, stream, 0u), (uint2)(key0, key1));
  const float r0 = sqrt(-2.0f * log(uniform_open(bits.x))), r1 = sqrt(-2.0f * log(uniform_open(bits.z)));
  const float a0 = 6.283185307f * uniform01(bits.y), a1 = 6.283185307f * uniform01(bits.w);
  const float3 xi = (float3)(r0 * cos(a0), r0 * sin(a0), r1 * cos(a1));
  const float4 raw = vload4(k, quats), q = raw * rsqrt(dot(raw, raw));
  const float w = q.x, x = q.y, y = q.z, z = q.w;
  const float3 c0 = (float3)(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y));  // columns
  const float3 c1 = (float3)(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x));
  const float3 c2 = (float3)(2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y));
  const float3 variance = exp(2.0f * vload3(k, log_scales));
  const float3 along = variance.x * dot(c0, xi) * c0 + variance.y * dot(c1, xi) * c1 + variance.z * dot(c2, xi) * c2;
  vstore3(vload3(k, means) + rate * seen * along, k, means);
}
