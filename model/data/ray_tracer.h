// Pictures of a mesh by tracing rays (Embree).
#pragma once
#include <memory>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/data/mesh.h"

namespace vsplat {

// Keeps a reference to the mesh, whose corners all have finite positions and normals or zero in their place.
class RayTracer {
 public:
  explicit RayTracer(const Mesh& mesh);
  ~RayTracer();
  RayTracer(const RayTracer&) = delete;
  RayTracer& operator=(const RayTracer&) = delete;

  // [height][width][4]: sRGB-encoded colour and straight alpha, the mean of samples x samples rays a pixel; black
  // where nothing is hit. Light comes from everywhere, more from above (+y), and some from one side, fixed to the
  // object, so that every view shows the same colours. No shadows, no gloss. Distortion is ignored.
  // By so many threads, 0: one a processor; the same bits whatever their number.
  Image picture(const Camera& camera, int samples = 2, unsigned threads = 0) const;

 private:
  struct Scene;
  std::unique_ptr<Scene> scene_;
  const Mesh& mesh_;
};

}  // namespace vsplat
