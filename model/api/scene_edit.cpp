// Changing scenes in place.
#include "model/base/scene_edit.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <optional>

#include "model/api/scene.h"
#include "model/base/axes.h"
#include "model/base/scene_filter.h"
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

void need_finite(const double (&values)[3], const char* what) {
  for (size_t c = 0; c < 3; ++c)
    if (!std::isfinite(values[c])) fail(Status::usage, "{}[{}] is {}: a finite number expected", what, c, values[c]);
}

void need_length(double value, const char* what) {
  if (!(value >= 0) || !std::isfinite(value)) fail(Status::usage, "{} is {}: 0 or more expected", what, value);
}

// The box, if its corners are in order.
Box box_of(const double* low, const double* high, const char* low_name, const char* high_name) {
  for (int c = 0; c < 3; ++c)
    if (!(low[c] <= high[c]))
      fail(Status::usage, "{2}[{0}] is {3} and {4}[{0}] is {1}: {2} must be at most {4}", c, high[c], low_name, low[c],
           high_name);
  return {Eigen::Vector3d(low[0], low[1], low[2]), Eigen::Vector3d(high[0], high[1], high[2])};
}

SceneFilter filter_of(const vsplat_scene_edit_options& o) {
  SceneFilter out;
  if (o.has_box) out.box = box_of(o.box_low, o.box_high, "options.box_low", "options.box_high");
  need_length(o.sphere_radius, "options.sphere_radius");
  need_finite(o.sphere_centre, "options.sphere_centre");
  if (o.sphere_radius > 0)
    out.sphere = Sphere{{o.sphere_centre[0], o.sphere_centre[1], o.sphere_centre[2]}, o.sphere_radius};
  if (!(o.min_opacity >= 0 && o.min_opacity <= 1))
    fail(Status::usage, "options.min_opacity is {}: 0 to 1 expected", o.min_opacity);
  out.min_opacity = o.min_opacity;
  need_length(o.max_size, "options.max_size");
  out.max_size = o.max_size;
  out.without_floaters = o.remove_floaters != 0;
  return out;
}

// How the scene turns, is scaled and moves; sets its up direction before that.
Similarity movement_of(const vsplat_scene_edit_options& o, Scene& scene) {
  const char* const from = o.from_axes ? o.from_axes : "RDF";
  Similarity out;
  out.rotation = change_of_axes(from, o.to_axes ? o.to_axes : from);
  const Eigen::Vector3d up = up_of_axes(from);
  if (const auto given = up_of(o.up, "options.up")) scene.up = given;
  if (!scene.up && o.from_axes)
    scene.up = {static_cast<float>(up.x()), static_cast<float>(up.y()), static_cast<float>(up.z())};
  if (o.upright) {
    if (!scene.up)
      fail(Status::usage,
           "options.upright is 1, but the scene does not say which direction is up, and options.up does not either");
    const Eigen::Vector3d now((*scene.up)[0], (*scene.up)[1], (*scene.up)[2]);
    // A direction that is up to rounding stays as it is.
    if ((now - up).norm() > 1e-6) out.rotation *= Eigen::Quaterniond::FromTwoVectors(now, up).toRotationMatrix();
  }
  need_length(o.scale, "options.scale");
  if (o.scale > 0) out.scale = o.scale;
  need_finite(o.translation, "options.translation");
  out.translation = {o.translation[0], o.translation[1], o.translation[2]};
  return out;
}

// Leaves the values identical bit for bit if nothing moves.
void move_scene(Scene& scene, const Similarity& move) {
  if (move.scale == 1 && move.rotation.isIdentity(0) && move.translation.isZero(0)) return;
  const Eigen::Vector3d offset = scene.offset.isZero(0) ? scene.offset : move.apply(scene.offset);
  vsplat::transform(scene, move, offset);
}

}  // namespace

vsplat_status vsplat_scene_edit(vsplat_scene scene, const vsplat_scene_edit_options* options,
                                vsplat_scene_edit_result* out_result) {
  return guarded([&] {
    need(scene, "scene");
    const vsplat_scene_edit_options o = taken(options, VSPLAT_SCENE_EDIT_OPTIONS_INIT, "options");
    if (out_result) require_output(out_result, "out_result");
    if (o.sh_degree < -1 || o.sh_degree > 4)
      fail(Status::usage, "options.sh_degree is {}: 0 to 4, or -1, expected", o.sh_degree);
    const SceneFilter what = filter_of(o);
    vsplat_scene_edit_result result = VSPLAT_SCENE_EDIT_RESULT_INIT;
    edit(scene, [&](Scene& s) {
      const Similarity move = movement_of(o, s);
      const FilteredGaussians removed = filter(s, what);
      move_scene(s, move);
      if (o.sh_degree >= 0) set_degree(s.gaussians, o.sh_degree);
      result.count = s.gaussians.count;
      result.outside_box = removed.box;
      result.outside_sphere = removed.sphere;
      result.below_opacity = removed.opacity;
      result.above_size = removed.size;
      result.floaters = removed.floaters;
      result.mirrored = move.rotation.determinant() < 0;
    });
    if (out_result) give(out_result, result, "out_result");
  });
}

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
    SceneFilter what;
    what.box = box_of(low, high, "low", "high");
    edit(scene, [&](Scene& s) { filter(s, what); });
  });
}
