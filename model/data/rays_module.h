// What finds where rays meet triangles: Embree, which is larger than all else that the library needs together. So it is
// in a module of its own, which is loaded where meshes are drawn, and missed by nobody who draws none.
#pragma once
#include <cstddef>

namespace vsplat {

struct RayHit {
  unsigned triangle;
  float u, v;       // of the triangle's second and third corner
  float normal[3];  // of any length, by the triangle's winding
};

// Triangles' corners, three after another, at every `stride`-th byte three floats. They are copied.
struct RayTriangles {
  const float* corners;
  std::size_t stride, count;
  // Whether a ray goes on through where it meets a triangle; null: none does. From any thread.
  bool (*passes)(const void* user, unsigned triangle, float u, float v);
  const void* user;
};

// The module's functions; from any thread, of one scene's those that trace.
struct RayFunctions {
  // 0 and the scene; 1: not enough memory; 2: Embree's error, as `error` tells it.
  int (*open)(const RayTriangles* triangles, void** scene, int* error);
  void (*close)(void* scene);
  bool (*trace)(void* scene, const float* origin, const float* direction, RayHit* hit);
};

// What the module has under the name vsplat_rays: null where it is of another version than it is asked for.
using RayModule = const RayFunctions*(const char* version);

}  // namespace vsplat
