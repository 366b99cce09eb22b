#include "model/input/views.h"

#include <algorithm>
#include <cmath>

#include "model/base/lens.h"
#include "model/base/resample.h"
#include "model/io/image_file.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// The framing the network is trained on: this many cube edges fill the picture.
constexpr double edges_in_picture = 1.5;

void check_sizes(const Camera& camera, const Image& picture, const Image* mask, const PictureNames& names) {
  const int w = picture.width, h = picture.height;
  if (mask && (mask->width != w || mask->height != h))
    fail(Status::input, "{} is {} x {} pixels, its picture {} is {} x {}: a mask must have its picture's size",
         names.mask, mask->width, mask->height, names.picture, w, h);
  if (camera.width == 0 && camera.height == 0) return;
  if (camera.width == w && camera.height == h) return;
  if (camera.width == h && camera.height == w)
    fail(Status::input,
         "{} is {} x {} pixels, its camera {} x {}: the picture fits its camera only after turning by 90 degrees (EXIF "
         "orientation is not applied); store it turned",
         names.picture, w, h, camera.width, camera.height);
  fail(Status::input,
       "{} is {} x {} pixels, its camera {} x {}: give the picture in its camera's size, or intrinsics for the "
       "picture's",
       names.picture, w, h, camera.width, camera.height);
}

void warn_of_dark_mask(const Image& mask, const PictureNames& names) {
  const float brightest = *std::max_element(mask.data.begin(), mask.data.end());
  if (brightest < 0.5f)
    warn(
        "{}: the brightest value of the mask is {:.0f} of 255; white is the object, so little or nothing of the "
        "picture is left",
        names.mask, 255 * brightest);
}

// The listed camera with what it leaves open filled in from the picture.
Camera completed(Camera camera, const Image& picture) {
  const bool no_size = camera.width == 0 && camera.height == 0;
  camera.width = picture.width;
  camera.height = picture.height;
  if (std::isnan(camera.cx) || (no_size && camera.cx == 0)) camera.cx = 0.5 * picture.width;
  if (std::isnan(camera.cy) || (no_size && camera.cy == 0)) camera.cy = 0.5 * picture.height;
  return camera;
}

Window object_window(const Camera& camera, const Framing& framing, const PictureNames& names) {
  const Eigen::Vector3d at =
      (camera.w2c * Eigen::Vector4d(framing.centre.x(), framing.centre.y(), framing.centre.z(), 1)).head<3>();
  if (!(at.z() > 0))
    fail(Status::input,
         "{}: the cube's centre ({}, {}, {}) is not in front of this camera (camera z {:.4g}); no square can be cut "
         "about it",
         names.picture, framing.centre.x(), framing.centre.y(), framing.centre.z(), at.z());
  const double side = edges_in_picture * framing.edge * std::max(camera.fx, camera.fy) / at.z();
  if (!(side > 0) || side > static_cast<double>(framing.size) * std::max(camera.width, camera.height))
    fail(Status::input,
         "{}: a square of {} cube edges is {:.4g} pixels wide at the cube's centre (camera z {:.4g}, edge {:.4g}); "
         "the picture, {} x {}, would be less than a pixel",
         names.picture, edges_in_picture, side, at.z(), framing.edge, camera.width, camera.height);
  const double u = camera.fx * at.x() / at.z() + camera.cx, v = camera.fy * at.y() / at.z() + camera.cy;
  return {u - 0.5 * side, v - 0.5 * side, side, framing.size};
}

// Whole pixels, so that a crop without scaling keeps them.
Window centred_window(const Camera& camera, int side, int size) {
  const auto corner = [&](int length) { return std::floor(0.5 * (length - side)); };
  return {corner(camera.width), corner(camera.height), static_cast<double>(side), size};
}

Window find_window(const Camera& camera, const Framing& framing, const PictureNames& names) {
  const int shorter = std::min(camera.width, camera.height), longer = std::max(camera.width, camera.height);
  switch (framing.fit) {
    case Fit::crop:
      return centred_window(camera, shorter, framing.size);
    case Fit::pad:
      return centred_window(camera, longer, framing.size);
    case Fit::automatic:
      if (shorter == longer) return centred_window(camera, longer, framing.size);
      break;
    case Fit::object:
      break;
  }
  return object_window(camera, framing, names);
}

PreparedView prepared(FramedView view) { return {on_white(view.image), std::move(view.camera)}; }

}  // namespace

Fit fit_from_name(const std::string& name) {
  if (name == "auto") return Fit::automatic;
  if (name == "object") return Fit::object;
  if (name == "crop") return Fit::crop;
  if (name == "pad") return Fit::pad;
  fail(Status::usage, "fit {}: auto, object, crop or pad is expected", name);
}

FramedView frame_view(const Camera& listed, const Image& picture, const Image* mask, const Framing& framing,
                      const PictureNames& names) {
  if (framing.size < 1 || picture.empty() || (picture.channels != 3 && picture.channels != 4) ||
      (mask && mask->channels != 1))
    fail(Status::internal, "frame_view: {} channels, size {}", picture.channels, framing.size);
  check_sizes(listed, picture, mask, names);
  if (mask) warn_of_dark_mask(*mask, names);
  const Camera camera = completed(listed, picture);
  if (!(camera.fx > 0) || !(camera.fy > 0))
    fail(Status::input, "{}: focal lengths {} and {}; positive ones are expected", names.picture, camera.fx, camera.fy);
  const Window window = find_window(camera, framing, names);
  const Image source = premultiplied(picture, mask);
  FramedView out;
  out.image = is_pinhole(camera.distortion) ? resample(source, window) : resample_undistorted(source, window, camera);
  out.camera = camera;
  out.camera.distortion = {};
  out.camera.width = out.camera.height = framing.size;
  const double scale = framing.size / window.side;
  out.camera.fx = camera.fx * scale;
  out.camera.fy = camera.fy * scale;
  out.camera.cx = (camera.cx - window.x0) * scale;
  out.camera.cy = (camera.cy - window.y0) * scale;
  return out;
}

FramedView frame_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing) {
  const std::string name = camera.file.empty() ? "the picture" : camera.file;
  return frame_view(camera, picture, mask, framing, {name, "the mask of " + name});
}

PreparedView prepare_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing) {
  return prepared(frame_view(camera, picture, mask, framing));
}

PreparedView prepare_view(const Camera& camera, const std::string& picture_path, const std::string& mask_path,
                          const Framing& framing) {
  const Image picture = read_image(picture_path);
  const Image mask = mask_path.empty() ? Image() : read_mask(mask_path);
  return prepared(frame_view(camera, picture, mask_path.empty() ? nullptr : &mask, framing, {picture_path, mask_path}));
}

}  // namespace vsplat
