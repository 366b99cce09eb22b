// Changing scenes in place.
#include "model/base/scene_edit.h"

#include <cmath>

#include "model/api/scene.h"
#include "runtime/fail.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

Similarity similarity_of(const double* transform) {
  Eigen::Matrix4d m;
  for (int i = 0; i < 16; ++i) m(i / 4, i % 4) = transform[i];
  if (!m.allFinite() || m.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    fail(Status::input, "transform: its last row is {} {} {} {}: 0 0 0 1 expected there, and finite numbers everywhere",
         m(3, 0), m(3, 1), m(3, 2), m(3, 3));
  return Similarity::from_matrix(m);
}

// Replaces the scene by a copy that `change` has modified.
template <class F>
void edit(vsplat_scene scene, const F& change) {
  auto made = std::make_shared<Scene>(*scene->now());
  change(*made);
  const Gaussians& g = made->gaussians;
  for (const std::vector<float>* values : {&g.means, &g.scales})
    for (const float v : *values)
      if (!std::isfinite(v)) fail(Status::input, "transform: it moves a Gaussian beyond the range of floats");
  if (!(made->offset.cwiseAbs().maxCoeff() <= kFarthestOffset))
    fail(Status::input, "transform: it moves the scene's offset to {} {} {}: at most {} either way expected",
         made->offset.x(), made->offset.y(), made->offset.z(), kFarthestOffset);
  scene->become(std::move(made));
}

}  // namespace

vsplat_status vsplat_scene_append(vsplat_scene scene, vsplat_scene other, const double transform[16]) {
  return guarded([&] {
    need(scene, "scene");
    need(other, "other");
    const Similarity move = transform ? similarity_of(transform) : Similarity();
    const std::shared_ptr<const Scene> more = other->now();
    edit(scene, [&](Scene& s) { append(s, *more, move); });
  });
}

vsplat_status vsplat_scene_transform(vsplat_scene scene, const double transform[16]) {
  return guarded([&] {
    need(scene, "scene");
    need(transform, "transform");
    const Similarity move = similarity_of(transform);
    edit(scene, [&](Scene& s) {
      const Eigen::Vector3d offset = s.offset.isZero(0) ? s.offset : move.apply(s.offset);
      vsplat::transform(s, move, offset);
    });
  });
}

vsplat_status vsplat_scene_remove(vsplat_scene scene, const uint8_t* removed, size_t count) {
  return guarded([&] {
    need(scene, "scene");
    need_array(removed, count, "removed");
    edit(scene, [&](Scene& s) {
      if (count != s.gaussians.count)
        fail(Status::usage, "count is {}: the scene has {} Gaussians", count, s.gaussians.count);
      keep(s.gaussians, [&](std::size_t k) { return removed[k] == 0; });
    });
  });
}

vsplat_status vsplat_scene_crop(vsplat_scene scene, const double low[3], const double high[3]) {
  return guarded([&] {
    need(scene, "scene");
    need(low, "low");
    need(high, "high");
    for (int c = 0; c < 3; ++c)
      if (!(low[c] <= high[c]))
        fail(Status::usage, "low[{0}] is {1} and high[{0}] is {2}: low must be at most high", c, low[c], high[c]);
    edit(scene, [&](Scene& s) {
      const Gaussians& g = s.gaussians;
      keep(s.gaussians, [&](std::size_t k) {
        bool in = true;
        for (std::size_t c = 0; c < 3; ++c) {
          const double at = static_cast<double>(g.means[3 * k + c]) + s.offset[static_cast<Eigen::Index>(c)];
          in = in && at >= low[c] && at <= high[c];
        }
        return in;
      });
    });
  });
}
