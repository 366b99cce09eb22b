// LaRa's maps, from the maps that surfels were drawn into, and their derivative: colours clamped to [0, 1], depths
// divided by alpha, normals in world axes, and normals of the surface that neighbouring depths span.
// ```
// argument       type  shape    what
// colour         f32   [H,W,3]  as in rasterize_surfels.cl, and so are
// alpha, depth   f32   [H,W]
// normal         f32   [H,W,3]
// views          f32   [..,32]  cameras as in project.cl, of which `view` is meant
// image          f32   [H,W,3]  written: colour, clamped to [0, 1]
// mean_depth     f32   [H,W]    written: depth / alpha, 0 where alpha is 0
// world_normal   f32   [H,W,3]  written: normal in the world's axes
// depth_normal   f32   [H,W,3]  written: alpha times the unit normal, in the world's axes, of the points under the
//                               pixels: down x right, the differences between the neighbours below and above and
//                               to the right and left; 0 along the picture's edges
// width, height  int            pixels
// work-items     one per pixel
// ```
#include "common.clh"

// A pixel's point in the camera's axes, seen from the camera; 0 where nothing is drawn.
static inline float3 point_at(global const float* alpha, global const float* depth, global const float* camera,
                              int width, int x, int y) {
  const size_t at = (size_t)y * width + x;
  const float z = alpha[at] > 0.0f ? depth[at] / alpha[at] : 0.0f;
  return z * (float3)(((float)x + 0.5f - camera[17]) / camera[15], ((float)y + 0.5f - camera[18]) / camera[16], 1.0f);
}

// The normal at a pixel, from the points around it.
typedef struct {
  float3 down, right, normal;  // the normal of length 1
  float inverse;               // one over its original length
} Surface;

#define SHORTEST 1e-12f  // normals shorter than this are divided by it instead of by their length

static inline Surface surface_at(global const float* alpha, global const float* depth, global const float* camera,
                                 int width, int x, int y) {
  Surface s;
  s.down = point_at(alpha, depth, camera, width, x, y + 1) - point_at(alpha, depth, camera, width, x, y - 1);
  s.right = point_at(alpha, depth, camera, width, x + 1, y) - point_at(alpha, depth, camera, width, x - 1, y);
  const float3 n = cross(s.down, s.right);
  s.inverse = 1.0f / max(length(n), SHORTEST);
  s.normal = n * s.inverse;
  return s;
}

static inline float3 to_world(global const float* camera, float3 a) {
  return a.x * vload3(0, camera) + a.y * vload3(1, camera) + a.z * vload3(2, camera);
}

static inline float3 to_camera(global const float* camera, float3 a) {
  return (float3)(dot(vload3(0, camera), a), dot(vload3(1, camera), a), dot(vload3(2, camera), a));
}

static inline bool is_inside(int x, int y, int width, int height) {
  return x > 0 && y > 0 && x + 1 < width && y + 1 < height;
}

kernel void lara_maps_forward(global const float* colour, global const float* alpha, global const float* depth,
                              global const float* normal, global const float* views, int view, global float* image,
                              global float* mean_depth, global float* world_normal, global float* depth_normal,
                              int width, int height) {
  const int at = get_global_id(0);
  if (at >= width * height) return;
  global const float* camera = views + (size_t)view * 32;
  const int x = at % width, y = at / width;
  vstore3(clamp(vload3(at, colour), 0.0f, 1.0f), at, image);
  mean_depth[at] = alpha[at] > 0.0f ? depth[at] / alpha[at] : 0.0f;
  vstore3(to_world(camera, vload3(at, normal)), at, world_normal);
  float3 n = 0.0f;
  if (is_inside(x, y, width, height))
    n = alpha[at] * to_world(camera, surface_at(alpha, depth, camera, width, x, y).normal);
  vstore3(n, at, depth_normal);
}

// ```
// argument        type  shape    what
// dimage          f32   [H,W,3]  gradients of the four maps, and
// dalpha          f32   [H,W]    that by alpha from elsewhere; any of them null: zeros
// dmean_depth     f32   [H,W]
// dworld_normal   f32   [H,W,3]
// ddepth_normal   f32   [H,W,3]
// dcolour         f32   [H,W,3]  written; null: not wanted
// by_alpha        f32   [H,W]    written, as by_depth [H,W]; both null: not written. The alpha that depth_normal is
//                                multiplied by counts as constant, as in LaRa
// by_normal       f32   [H,W,3]  written; null: not wanted
// work-items      one per pixel
// ```
// The gradient by the point under a pixel, from the neighbours whose normals it is part of.
static inline float3 point_backward(global const float* alpha, global const float* depth, global const float* camera,
                                    global const float* ddepth_normal, int width, int height, int x, int y) {
  float3 sum = 0.0f;
  for (int side = 0; side < 4; ++side) {
    const int step = side % 2 ? -1 : 1, nx = x - (side < 2 ? 0 : step), ny = y - (side < 2 ? step : 0);
    if (!is_inside(nx, ny, width, height)) continue;
    const size_t at = (size_t)ny * width + nx;
    const Surface s = surface_at(alpha, depth, camera, width, nx, ny);
    const float3 by_unit = alpha[at] * to_camera(camera, vload3(at, ddepth_normal));
    const bool held = s.inverse >= 1.0f / SHORTEST;
    const float3 by = s.inverse * (held ? by_unit : by_unit - dot(by_unit, s.normal) * s.normal);
    sum += (float)step * (side < 2 ? cross(s.right, by) : cross(by, s.down));
  }
  return sum;
}

kernel void lara_maps_backward(global const float* colour, global const float* alpha, global const float* depth,
                               global const float* views, int view, global const float* dimage,
                               global const float* dalpha, global const float* dmean_depth,
                               global const float* dworld_normal, global const float* ddepth_normal,
                               global float* dcolour, global float* by_alpha, global float* by_depth,
                               global float* by_normal, int width, int height) {
  const int at = get_global_id(0);
  if (at >= width * height) return;
  global const float* camera = views + (size_t)view * 32;
  const int x = at % width, y = at / width;
  if (dcolour) {
    const float3 c = vload3(at, colour), by = dimage ? vload3(at, dimage) : (float3)(0.0f);
    vstore3(select((float3)(0.0f), by, (c >= 0.0f) & (c <= 1.0f)), at, dcolour);
  }
  if (by_normal) vstore3(dworld_normal ? to_camera(camera, vload3(at, dworld_normal)) : (float3)(0.0f), at, by_normal);
  if (!by_alpha) return;
  float by = dmean_depth ? dmean_depth[at] : 0.0f;
  if (ddepth_normal) {
    const float3 ray =
        (float3)(((float)x + 0.5f - camera[17]) / camera[15], ((float)y + 0.5f - camera[18]) / camera[16], 1.0f);
    by += dot(point_backward(alpha, depth, camera, ddepth_normal, width, height, x, y), ray);
  }
  const float a = alpha[at], inverse = a > 0.0f ? 1.0f / a : 0.0f;
  by_depth[at] = by * inverse;
  by_alpha[at] = (dalpha ? dalpha[at] : 0.0f) - by * inverse * inverse * depth[at];
}
