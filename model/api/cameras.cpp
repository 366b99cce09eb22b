#include "model/api/cameras.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <cmath>

#include "model/api/input.h"
#include "model/api/scene.h"
#include "model/io/picture/image_file.h"
#include "model/io/views/cameras_json.h"
#include "model/io/views/view_checks.h"
#include "model/io/views/view_set.h"
#include "model/views/camera_path.h"
#include "model/views/orbit.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat::api {

vsplat_camera describe(const Camera& camera) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = camera.width;
  out.height = camera.height;
  out.fx = camera.fx;
  out.fy = camera.fy;
  out.cx = camera.cx;
  out.cy = camera.cy;
  for (int i = 0; i < 16; ++i) out.w2c[i] = camera.w2c(i / 4, i % 4);
  return out;
}

namespace {

Distortion lens_of(const vsplat_camera& camera, const char* what) {
  Distortion out;
  switch (value_of(camera.lens)) {
    case VSPLAT_LENS_PINHOLE:
      break;
    case VSPLAT_LENS_OPENCV:
      out.model = Distortion::Model::opencv;
      break;
    case VSPLAT_LENS_FISHEYE:
      out.model = Distortion::Model::fisheye;
      break;
    default:
      fail(Status::usage, "{}.lens is {}, not a value of vsplat_lens", what, value_of(camera.lens));
  }
  const std::size_t count = out.model == Distortion::Model::none ? 0 : out.model == Distortion::Model::opencv ? 8 : 4;
  for (std::size_t i = 0; i < std::size(camera.lens_values); ++i) {
    if (i >= count && camera.lens_values[i] != 0)
      fail(Status::usage, "{}.lens_values[{}] is {}: the lens has {} values, and the rest must be 0", what, i,
           camera.lens_values[i], count);
    out.k[i] = camera.lens_values[i];
  }
  return out;
}

}  // namespace

Camera camera_of(const vsplat_camera& camera, const char* what, bool may_have_lens) {
  const vsplat_camera c = taken(&camera, VSPLAT_CAMERA_INIT, what);
  Camera out;
  out.width = picture_side(what, "width", c.width);
  out.height = picture_side(what, "height", c.height);
  out.fx = c.fx;
  out.fy = c.fy;
  out.cx = c.cx;
  out.cy = c.cy;
  for (const double v : {c.fx, c.fy, c.cx, c.cy})  // readers' checks accept intrinsics that a file leaves open
    if (!std::isfinite(v)) fail(Status::input, "{}: an intrinsic is {}", what, v);
  out.distortion = lens_of(c, what);
  if (!may_have_lens && out.distortion.model != Distortion::Model::none)
    fail(Status::usage, "{}.lens is {}: pictures are drawn as a pinhole camera sees them", what, value_of(c.lens));
  check_intrinsics(what, out);
  Eigen::Matrix4d w2c;
  for (int i = 0; i < 16; ++i) w2c(i / 4, i % 4) = c.w2c[i];
  out.w2c = checked_rigid(what, "w2c", w2c);
  return out;
}

namespace {

constexpr int orbit_side = 512;

OrbitOptions orbit_options(const vsplat_orbit_options& o) {
  OrbitOptions out;
  if (o.count < 1) fail(Status::usage, "options.count is {}: an orbit has at least one camera", o.count);
  if (o.radius < 0) fail(Status::usage, "options.radius is {}", o.radius);
  if (o.radius > 0) out.radius = o.radius;
  if (o.has_elevation) out.elevation_deg = o.elevation;
  if (o.has_up) out.up = Eigen::Vector3d(o.up[0], o.up[1], o.up[2]);
  return out;
}

vsplat_cameras new_cameras(std::vector<Camera> cameras, ViewSet listed = {}) {
  auto out = std::make_unique<vsplat_cameras_impl>();
  out->cameras = std::move(cameras);
  out->listed = std::move(listed);
  return out.release();
}

// `width`, `height`: for a view whose list gives no size.
Camera drawn_from(ListedView view, const ViewSet& set, int width, int height) {
  if (is_resolved(view)) return view.camera;
  const ImageInfo size = view.picture.empty() ? ImageInfo{width, height} : read_image_info(view.picture.string());
  if (size.width < 1 || size.height < 1)
    fail(Status::input, "{}: camera {} has neither a size nor a picture to take it from", set.source.string(),
         printable(view.name));
  resolve_intrinsics(view, size.width, size.height);
  return view.camera;
}

vsplat_cameras load_cameras(const char* path, const vsplat_cameras_options& o) {
  ViewSet set = read_views(
      path,
      {.need_pictures = false, .use_pictures = false, .bad = o.skip_bad ? BadViews::leave_out : BadViews::refuse});
  std::erase_if(set.views, [](const ListedView& view) { return !view.problem.empty(); });
  std::vector<Camera> cameras;
  for (const ListedView& view : set.views) cameras.push_back(drawn_from(view, set, o.width, o.height));
  return new_cameras(std::move(cameras), std::move(set));
}

}  // namespace
}  // namespace vsplat::api

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_cameras_load(const char* path, int32_t width, int32_t height, vsplat_cameras* out_cameras) {
  return guarded([&] {
    need(path, "path");
    need(out_cameras, "out_cameras");
    vsplat_cameras_options options = VSPLAT_CAMERAS_OPTIONS_INIT;
    options.width = width, options.height = height;
    *out_cameras = load_cameras(path, options);
  });
}

vsplat_status vsplat_cameras_load_with(const char* path, const vsplat_cameras_options* options,
                                       vsplat_cameras* out_cameras) {
  return guarded([&] {
    need(path, "path");
    need(out_cameras, "out_cameras");
    *out_cameras = load_cameras(path, taken(options, VSPLAT_CAMERAS_OPTIONS_INIT, "options"));
  });
}

vsplat_status vsplat_cameras_create(const vsplat_camera* cameras, size_t count, vsplat_cameras* out_cameras) {
  return guarded([&] {
    need_structs(cameras, count, "cameras");
    need(out_cameras, "out_cameras");
    if (count == 0) fail(Status::usage, "count is 0: at least one camera expected");
    std::vector<Camera> all;
    for (size_t i = 0; i < count; ++i)
      all.push_back(camera_of(element(cameras, i, "cameras"), fmt::format("cameras[{}]", i).c_str()));
    *out_cameras = new_cameras(std::move(all));
  });
}

vsplat_status vsplat_camera_look_at(const double* eye, const double* target, const double* up,
                                    vsplat_camera* out_camera) {
  return guarded([&] {
    need(eye, "eye");
    need(target, "target");
    need(up, "up");
    need(out_camera, "out_camera");
    vsplat_camera turned = taken(out_camera, VSPLAT_CAMERA_INIT, "out_camera");
    const Eigen::Vector3d from(eye[0], eye[1], eye[2]), at(target[0], target[1], target[2]),
        upwards(up[0], up[1], up[2]);
    const double across = (at - from).cross(upwards).norm();
    if (!(across > 1e-9 * (at - from).norm() * upwards.norm()) || !std::isfinite(across))
      fail(Status::input,
           "a camera at {}, {}, {} that looks at {}, {}, {} with {}, {}, {} upwards: two different places, and an "
           "upward direction that is not along the view, are expected",
           eye[0], eye[1], eye[2], target[0], target[1], target[2], up[0], up[1], up[2]);
    const Eigen::Matrix4d w2c = look_at(from, at, upwards);
    for (int i = 0; i < 16; ++i) turned.w2c[i] = w2c(i / 4, i % 4);
    give(out_camera, turned, "out_camera");
  });
}

vsplat_status vsplat_cameras_path(vsplat_cameras keys, int32_t count, vsplat_cameras* out_cameras) {
  return guarded([&] {
    need(keys, "keys");
    need(out_cameras, "out_cameras");
    *out_cameras = new_cameras(camera_path(keys->cameras, count));
  });
}

vsplat_status vsplat_cameras_orbit_input(vsplat_input input, const vsplat_orbit_options* options,
                                         vsplat_cameras* out_cameras) {
  return guarded([&] {
    need(input, "input");
    need(out_cameras, "out_cameras");
    const vsplat_orbit_options o = taken(options, VSPLAT_ORBIT_OPTIONS_INIT, "options");
    OrbitOptions how = orbit_options(o);
    if (!how.up) how.up = input->up;
    how.edge = input->input.placement.edge;
    *out_cameras =
        new_cameras(orbit_about(cameras_of(input->input), input->input.placement.centre, o.count,
                                o.width > 0 ? o.width : orbit_side, o.height > 0 ? o.height : orbit_side, how));
  });
}

vsplat_status vsplat_cameras_orbit_scene(vsplat_scene scene, const vsplat_orbit_options* options,
                                         vsplat_cameras* out_cameras) {
  return guarded([&] {
    need(scene, "scene");
    need(out_cameras, "out_cameras");
    const vsplat_orbit_options o = taken(options, VSPLAT_ORBIT_OPTIONS_INIT, "options");
    *out_cameras = new_cameras(orbit_about_scene(*scene->now(), o.count, o.width > 0 ? o.width : orbit_side,
                                                 o.height > 0 ? o.height : orbit_side, orbit_options(o)));
  });
}

vsplat_status vsplat_cameras_save(const vsplat_camera* cameras, size_t count, const char* const* files,
                                  const char* path) {
  return guarded([&] {
    need_structs(cameras, count, "cameras");
    need(path, "path");
    if (count == 0) fail(Status::usage, "count is 0: at least one camera expected");
    std::vector<Camera> all;
    for (size_t i = 0; i < count; ++i) {
      all.push_back(camera_of(element(cameras, i, "cameras"), fmt::format("cameras[{}]", i).c_str()));
      if (files) need(files[i], fmt::format("files[{}]", i).c_str());
      all.back().file = files ? files[i] : fmt::format("{:04}.png", i);
    }
    write_cameras(path, all);
  });
}

void vsplat_cameras_retain(vsplat_cameras cameras) { retain(cameras); }
void vsplat_cameras_release(vsplat_cameras cameras) { release(cameras); }

vsplat_status vsplat_cameras_count(vsplat_cameras cameras, size_t* out_count) {
  return guarded([&] {
    need(cameras, "cameras");
    need(out_count, "out_count");
    *out_count = cameras->cameras.size();
  });
}

vsplat_status vsplat_cameras_get(vsplat_cameras cameras, size_t index, vsplat_camera* out_camera) {
  return guarded([&] {
    need(cameras, "cameras");
    give(out_camera, describe(cameras->at(index)), "out_camera");
  });
}
