// Renders a mesh by ray tracing with the Embree module (rays_module.h).
#pragma once
#include <memory>
#include <string>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/data/mesh.h"

namespace vsplat {

// Keeps a reference to the mesh. All its corners must have finite positions, and finite or zero normals.
class RayTracer {
 public:
  // Error(internal) if the module is missing or of another version; Error(memory).
  explicit RayTracer(const Mesh& mesh);

  // [height][width][4]: sRGB-encoded colour and straight alpha, the mean of samples x samples rays per pixel; black
  // where nothing is hit. Light comes from all directions, more from above (+y), and some from one side, fixed to the
  // object, so that all views show the same colours. No shadows, no gloss. Ignores distortion.
  // `threads`: 0 means one per processor; the result is bitwise independent of it.
  Image picture(const Camera& camera, int samples = 2, unsigned threads = 0) const;

 private:
  struct Close {
    void operator()(void* scene) const;
  };
  std::unique_ptr<void, Close> scene_;
  const Mesh& mesh_;
};

// For tests, before the first RayTracer: loads the module from this path instead of from beside the library.
void set_rays_module(const std::string& path);

}  // namespace vsplat
