// Pictures of a mesh by tracing rays, by the module that has Embree (rays_module.h).
#pragma once
#include <memory>
#include <string>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/data/mesh.h"

namespace vsplat {

// Keeps a reference to the mesh, whose corners all have finite positions and normals or zero in their place.
class RayTracer {
 public:
  // Error(internal) where the module is not there, or of another version; Error(memory).
  explicit RayTracer(const Mesh& mesh);

  // [height][width][4]: sRGB-encoded colour and straight alpha, the mean of samples x samples rays a pixel; black
  // where nothing is hit. Light comes from everywhere, more from above (+y), and some from one side, fixed to the
  // object, so that every view shows the same colours. No shadows, no gloss. Distortion is ignored.
  // By so many threads, 0: one a processor; the same bits whatever their number.
  Image picture(const Camera& camera, int samples = 2, unsigned threads = 0) const;

 private:
  struct Close {
    void operator()(void* scene) const;
  };
  std::unique_ptr<void, Close> scene_;
  const Mesh& mesh_;
};

// Loads the module from there and not from beside the library: for tests, before the first RayTracer.
void set_rays_module(const std::string& path);

}  // namespace vsplat
