// From feature maps to the volume, for a run of n voxels from `first` on. Voxel (i R + j) R + k has its centre at
// ((i, j, k) + 0.5) / R - 0.5, i along x.
//   w2c [V, 4, 4], intrinsics [V, 4]: fx, fy, cx, cy in pixels
//   index i32 [n, V, 4], weight [n, V, 4]   the texels (v t t + y t + x) around each voxel's image in each view; weight
//   0 outside maps [V t t, C]                         features, or their projection lift_variance_forward: out [n, C] biased
//   variance over the V views of the bilinear samples lift_mean_forward:     out [.., C], rows first .. first + n: mean over
//   the views of the samples + bias [C]
// lift_corners: one work-item per (voxel, view). The others: a work-group takes VOXELS voxels one after the other, and
// its work-items share out the channels, LANES (1, 4 or 16) at a time. Any sizes >= 1.
#include "sample.clh"

#ifndef LANES
#define LANES 16
#endif
#ifndef VOXELS
#define VOXELS 8
#endif

kernel void lift_corners(global const float* w2c, global const float* intrinsics, global int4* index,
                         global float4* weight, int first, int n, int V, int R, int t, float image, float half_pixel) {
  const int id = get_global_id(0);
  if (id >= n * V) return;
  const int voxel = first + id / V, v = id % V;
  const float3 point =
      (float3)((voxel / (R * R) + 0.5f) / R - 0.5f, (voxel / R % R + 0.5f) / R - 0.5f, (voxel % R + 0.5f) / R - 0.5f);
  const Footprint f = footprint(point, w2c + v * 16, vload4(v, intrinsics), image, half_pixel, t);
  index[id] = f.texel + v * t * t;
  weight[id] = f.weight;
}

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#if LANES == 1
#define FLOATS float
#define LOAD(p) (*(p))
#define STORE(x, p) (*(p) = (x))
#else
#define FLOATS JOIN(float, LANES)
#define LOAD(p) JOIN(vload, LANES)(0, p)
#define STORE(x, p) JOIN(vstore, LANES)(x, 0, p)
#endif

static inline FLOATS sample(global const float* maps, int C, int4 at, float4 w) {
  FLOATS s = (FLOATS)(0.0f);
  if (w.x != 0.0f) s += w.x * LOAD(maps + (size_t)at.x * C);
  if (w.y != 0.0f) s += w.y * LOAD(maps + (size_t)at.y * C);
  if (w.z != 0.0f) s += w.z * LOAD(maps + (size_t)at.z * C);
  if (w.w != 0.0f) s += w.w * LOAD(maps + (size_t)at.w * C);
  return s;
}

static inline float sample_one(global const float* maps, int C, int4 at, float4 w) {
  float s = 0.0f;
  if (w.x != 0.0f) s += w.x * maps[(size_t)at.x * C];
  if (w.y != 0.0f) s += w.y * maps[(size_t)at.y * C];
  if (w.z != 0.0f) s += w.z * maps[(size_t)at.z * C];
  if (w.w != 0.0f) s += w.w * maps[(size_t)at.w * C];
  return s;
}

// Welford's recurrence: exact for equal samples, and as accurate as two passes, without keeping the samples.
kernel void lift_variance_forward(global const float* maps, global const int4* index, global const float4* weight,
                                  global float* out, int n, int V, int C) {
  const int end = min(n, ((int)get_group_id(0) + 1) * VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = get_group_id(0) * VOXELS; i < end; ++i) {
    global const int4* at = index + (size_t)i * V;
    global const float4* w = weight + (size_t)i * V;
    global float* to = out + (size_t)i * C;
    for (int c = lane * LANES; c < whole; c += lanes * LANES) {
      FLOATS mean = (FLOATS)(0.0f), square = (FLOATS)(0.0f);
      for (int v = 0; v < V; ++v) {
        const FLOATS s = sample(maps + c, C, at[v], w[v]);
        const FLOATS d = s - mean;
        mean += d * (1.0f / (v + 1));
        square += d * (s - mean);
      }
      STORE(square * (1.0f / V), to + c);
    }
    for (int c = whole + lane; c < C; c += lanes) {
      float mean = 0.0f, square = 0.0f;
      for (int v = 0; v < V; ++v) {
        const float s = sample_one(maps + c, C, at[v], w[v]);
        const float d = s - mean;
        mean += d * (1.0f / (v + 1));
        square += d * (s - mean);
      }
      to[c] = square * (1.0f / V);
    }
  }
}

kernel void lift_mean_forward(global const float* maps, global const int4* index, global const float4* weight,
                              global const float* bias, global float* out, int first, int n, int V, int C) {
  const int end = min(n, ((int)get_group_id(0) + 1) * VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = get_group_id(0) * VOXELS; i < end; ++i) {
    global const int4* at = index + (size_t)i * V;
    global const float4* w = weight + (size_t)i * V;
    global float* to = out + (size_t)(first + i) * C;
    for (int c = lane * LANES; c < whole; c += lanes * LANES) {
      FLOATS sum = (FLOATS)(0.0f);
      for (int v = 0; v < V; ++v) sum += sample(maps + c, C, at[v], w[v]);
      STORE(sum * (1.0f / V) + LOAD(bias + c), to + c);
    }
    for (int c = whole + lane; c < C; c += lanes) {
      float sum = 0.0f;
      for (int v = 0; v < V; ++v) sum += sample_one(maps + c, C, at[v], w[v]);
      to[c] = sum * (1.0f / V) + bias[c];
    }
  }
}

// Backward of lift_variance_forward by the samples: dsamples [n, V, C] = 2/V (sample - mean over the views) dout [n, C].
kernel void lift_variance_backward(global const float* maps, global const int4* index, global const float4* weight,
                                   global const float* dout, global float* dsamples, int n, int V, int C) {
  const int end = min(n, ((int)get_group_id(0) + 1) * VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = get_group_id(0) * VOXELS; i < end; ++i) {
    global const int4* at = index + (size_t)i * V;
    global const float4* w = weight + (size_t)i * V;
    global const float* from = dout + (size_t)i * C;
    global float* to = dsamples + (size_t)i * V * C;
    for (int c = lane * LANES; c < whole; c += lanes * LANES) {
      FLOATS mean = (FLOATS)(0.0f);
      for (int v = 0; v < V; ++v) {
        const FLOATS s = sample(maps + c, C, at[v], w[v]);
        mean += (s - mean) * (1.0f / (v + 1));
        STORE(s, to + (size_t)v * C + c);
      }
      const FLOATS d = LOAD(from + c) * (2.0f / V);
      for (int v = 0; v < V; ++v) STORE((LOAD(to + (size_t)v * C + c) - mean) * d, to + (size_t)v * C + c);
    }
    for (int c = whole + lane; c < C; c += lanes) {
      float mean = 0.0f;
      for (int v = 0; v < V; ++v) {
        const float s = sample_one(maps + c, C, at[v], w[v]);
        mean += (s - mean) * (1.0f / (v + 1));
        to[(size_t)v * C + c] = s;
      }
      const float d = from[c] * (2.0f / V);
      for (int v = 0; v < V; ++v) to[(size_t)v * C + c] = (to[(size_t)v * C + c] - mean) * d;
    }
  }
}
