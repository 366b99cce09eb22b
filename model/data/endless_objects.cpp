#include "model/data/endless_objects.h"

#include <fmt/format.h>

#include "model/data/random_object.h"
#include "model/data/ray_tracer.h"
#include "model/data/sphere_cameras.h"

namespace vsplat {
namespace {

constexpr int samples = 2;  // as in write_object()

struct Drawn {
  explicit Drawn(Mesh from) : mesh(std::move(from)), tracer(mesh) {}
  const Mesh mesh;
  const RayTracer tracer;
};

Mesh fitted(Mesh mesh) {
  fit_into_cube(mesh);
  return mesh;
}

}  // namespace

FramedObject endless_object(std::uint64_t seed, std::uint32_t index, int views, int size,
                            const TextureFolder* textures) {
  const auto drawn = std::make_shared<const Drawn>(fitted(random_object(seed, index, textures)));
  FramedObject out;
  out.name = fmt::format("procedural {}", index);
  out.label = "object " + out.name;
  ViewSet& set = out.photographs.set;
  for (const Camera& camera : sphere_cameras(views, size, radius_of(drawn->mesh), seed, index)) {
    ListedView view;
    view.camera = camera;
    view.name = camera.file;
    set.views.push_back(view);
  }
  set.source = out.name;
  std::vector<Camera> cameras;
  for (const ListedView& view : set.views) cameras.push_back(view.camera);
  out.photographs.picture = [drawn, cameras = std::move(cameras)](int view) {
    return drawn->tracer.picture(cameras.at(static_cast<std::size_t>(view)), samples, 1);
  };
  return out;
}

}  // namespace vsplat
