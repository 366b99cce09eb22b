// Lifts feature maps to a volume, for n voxels from voxel `first` on. Voxel (i R + j) R + k has its centre at ((i, j,
// k) + 0.5) / R - 0.5 of the object's frame, i along x. The maps have t x t texels; texel (x, y) of view v is row (v t
// + y) t + x.
// ```
// define         default  what
// define LANES   16       channels that a work-item processes at a time: 1, 4 or 16
// define VOXELS  8        voxels that a group processes one after the other
// ```
#include "common.clh"
#include "many_registers.clh"
#include "sample.clh"

#ifndef LANES
#define LANES 16
#endif
#ifndef VOXELS
#define VOXELS 8
#endif

// The places at which the views see each voxel.
// ```
// argument    type   shape    what
// w2c         f32    [V,4,4]  object's frame to camera, row-major
// intrinsics  f32    [V,4]    fx, fy, cx, cy in pixels
// index       i32    [n,V,4]  written: the rows of the four texels around the voxel's place in each view
// weight      f32    [n,V,4]  written: their bilinear weights; 0 outside of the map
// R           int             voxels along an edge of the volume
// image       float           edge of a picture, pixels
// half_pixel  float           0 or 0.5, see sample.clh
// work-items  one per (voxel, view)
// ```
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

// The bilinear sample of LANES channels: maps points to the first of them, at row 0. Texels of weight 0 are not read.
static inline FLOATS sample(global const float* maps, int C, int4 at, float4 w) {
  FLOATS s = (FLOATS)(0.0f);
  if (w.x != 0.0f) s += w.x * LOAD(maps + (size_t)at.x * C);
  if (w.y != 0.0f) s += w.y * LOAD(maps + (size_t)at.y * C);
  if (w.z != 0.0f) s += w.z * LOAD(maps + (size_t)at.z * C);
  if (w.w != 0.0f) s += w.w * LOAD(maps + (size_t)at.w * C);
  return s;
}

// The same of one channel.
static inline float sample_one(global const float* maps, int C, int4 at, float4 w) {
  float s = 0.0f;
  if (w.x != 0.0f) s += w.x * maps[(size_t)at.x * C];
  if (w.y != 0.0f) s += w.y * maps[(size_t)at.y * C];
  if (w.z != 0.0f) s += w.z * maps[(size_t)at.z * C];
  if (w.w != 0.0f) s += w.w * maps[(size_t)at.w * C];
  return s;
}

// ```
// argument    type  shape      what
// maps        f32   [V t t,C]  features
// index       i32   [n,V,4]    from lift_corners
// weight      f32   [n,V,4]    from lift_corners
// out         f32   [n,C]      written: the biased variance of the samples over the V views
// work-items  groups of any size, one per VOXELS voxels; a group's items share the channels, LANES at a time
// ```
// By Welford's recurrence, which gives exactly 0 for equal samples and is as accurate as two passes, without keeping
// the samples.
kernel MORE_REGISTERS void lift_variance_forward(global const float* maps, global const int4* index,
                                                 global const float4* weight, global float* out, int n, int V, int C) {
  const int begin = GROUP_ID(0) * VOXELS, end = min(n, begin + VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = begin; i < end; ++i) {
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

// ```
// argument    type  shape      what
// maps        f32   [V t t,C]  features, projected
// index       i32   [n,V,4]    from lift_corners
// weight      f32   [n,V,4]    from lift_corners
// bias        f32   [C]        added to the mean
// out         f32   [..,C]     rows first .. first + n - 1 are written: the mean of the samples over the views, + bias
// work-items  as in lift_variance_forward
// ```
kernel void lift_mean_forward(global const float* maps, global const int4* index, global const float4* weight,
                              global const float* bias, global float* out, int first, int n, int V, int C) {
  const int begin = GROUP_ID(0) * VOXELS, end = min(n, begin + VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = begin; i < end; ++i) {
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

// ```
// argument             type  shape    what
// maps, index, weight                 as in lift_variance_forward
// out                  f32   [n,V,C]  written: the samples
// work-items           as in lift_variance_forward
// ```
kernel void lift_samples_forward(global const float* maps, global const int4* index, global const float4* weight,
                                 global float* out, int n, int V, int C) {
  const int begin = GROUP_ID(0) * VOXELS, end = min(n, begin + VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = begin; i < end; ++i)
    for (int v = 0; v < V; ++v) {
      const size_t row = (size_t)i * V + v;
      global float* to = out + row * C;
      for (int c = lane * LANES; c < whole; c += lanes * LANES)
        STORE(sample(maps + c, C, index[row], weight[row]), to + c);
      for (int c = whole + lane; c < C; c += lanes) to[c] = sample_one(maps + c, C, index[row], weight[row]);
    }
}

// Backward of lift_variance_forward by the samples, which are then scattered to the maps.
// ```
// argument             type  shape    what
// maps, index, weight                 as in lift_variance_forward
// dout                 f32   [n,C]    gradient of out
// dsamples             f32   [n,V,C]  written: 2 / V (sample - mean over the views) dout
// work-items           as in lift_variance_forward
// ```
kernel MORE_REGISTERS void lift_variance_backward(global const float* maps, global const int4* index,
                                                  global const float4* weight, global const float* dout,
                                                  global float* dsamples, int n, int V, int C) {
  const int begin = GROUP_ID(0) * VOXELS, end = min(n, begin + VOXELS);
  const int whole = C / LANES * LANES, lanes = get_local_size(0), lane = get_local_id(0);
  for (int i = begin; i < end; ++i) {
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
