// Ray-triangle intersection with Embree. Embree is larger than all other dependencies together, so it is in a module
// that is loaded only to render meshes.
#pragma once
#include <cstddef>

namespace vsplat {

struct RayHit {
  unsigned triangle;
  float u, v;       // weights of the triangle's second and third corner
  float normal[3];  // of any length, oriented by the triangle's winding
};

// Corners of triangles, three per triangle, with three floats at every `stride`-th byte. They are copied.
struct RayTriangles {
  const float* corners;
  std::size_t stride, count;
  // Whether a ray passes through the triangle at this point; null: no ray does. Called from any thread.
  bool (*passes)(const void* user, unsigned triangle, float u, float v);
  const void* user;
};

// The module's functions. Thread-safe; on a single scene only `trace` is.
struct RayFunctions {
  // Returns 0 and the scene; 1 if there is not enough memory; 2 for another Embree error, whose code is in `error`.
  int (*open)(const RayTriangles* triangles, void** scene, int* error);
  void (*close)(void* scene);
  bool (*trace)(void* scene, const float* origin, const float* direction, RayHit* hit);
};

// The module's symbol vsplat_rays; returns null if the module has another version than requested.
using RayModule = const RayFunctions*(const char* version);

}  // namespace vsplat
