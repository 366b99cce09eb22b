#include "model/views/views.h"

#include <algorithm>
#include <cmath>

#include "model/base/lens.h"
#include "model/base/resample.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// The framing that the network is trained with: this many cube edges fill the picture.
constexpr double edges_in_picture = 1.5;

void check_sizes(const Camera& camera, const PixelRows& picture, const PixelRows* mask, const PictureNames& names) {
  const int w = picture.width, h = picture.height;
  if (mask && (mask->width != w || mask->height != h))
    fail(Status::input, "{} is {} x {} pixels, its picture {} is {} x {}: a mask must have its picture's size",
         names.mask, mask->width, mask->height, names.picture, w, h);
  if (camera.width == 0 && camera.height == 0) return;
  if (camera.width == w && camera.height == h) return;
  if (camera.width == h && camera.height == w)
    fail(
        Status::input,
        "{} is {} x {} pixels, its camera {} x {}: the picture fits its camera only after turning by 90 degrees; store "
        "it turned",
        names.picture, w, h, camera.width, camera.height);
  fail(Status::input,
       "{} is {} x {} pixels, its camera {} x {}: give the picture in its camera's size, or intrinsics for the "
       "picture's",
       names.picture, w, h, camera.width, camera.height);
}

void warn_of_dark_mask(float brightest, const PictureNames& names) {
  if (brightest < 0.5f)
    warn(
        "{}: the brightest value of the mask is {:.0f} of 255; white is the object, so little or nothing of the "
        "picture is left",
        names.mask, 255 * brightest);
}

// The listed camera, with unknown values taken from the picture.
Camera completed(Camera camera, const PixelRows& picture) {
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
         "around it",
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

// Aligned to whole pixels, so that a crop without scaling copies them.
Window centred_window(const Camera& camera, int side, int size) {
  const auto corner = [&](int length) { return std::floor(0.5 * (length - side)); };
  return {corner(camera.width), corner(camera.height), static_cast<double>(side), size};
}

Window find_window(const Camera& camera, const Framing& framing, const PictureNames& names) {
  const int shorter = std::min(camera.width, camera.height), longer = std::max(camera.width, camera.height);
  switch (framing.crop) {
    case Crop::crop:
      return centred_window(camera, shorter, framing.size);
    case Crop::pad:
      return centred_window(camera, longer, framing.size);
    case Crop::automatic:
      if (shorter == longer) return centred_window(camera, longer, framing.size);
      break;
    case Crop::object:
      break;
  }
  return object_window(camera, framing, names);
}

// The completed camera, after checking that the pictures agree with it.
Camera checked(const Camera& listed, const PixelRows& picture, const PixelRows* mask, const PictureNames& names) {
  if (picture.width < 1 || picture.height < 1 || (picture.channels != 3 && picture.channels != 4) ||
      (mask && mask->channels != 1))
    fail(Status::internal, "a view of {} channels", picture.channels);
  check_sizes(listed, picture, mask, names);
  Camera camera = completed(listed, picture);
  if (!(camera.fx > 0) || !(camera.fy > 0))
    fail(Status::input, "{}: focal lengths {} and {}; positive ones are expected", names.picture, camera.fx, camera.fy);
  return camera;
}

Image seen_through(PixelRows& source, const Window& window, const Camera& camera) {
  return is_pinhole(camera.distortion) ? resample(source, window) : resample_undistorted(source, window, camera);
}

Image seen_through(PixelRows& picture, PixelRows* mask, const Window& window, const Camera& camera,
                   const PictureNames& names) {
  PremultipliedRows source(picture, mask);
  Image out = seen_through(source, window, camera);
  if (mask) warn_of_dark_mask(source.brightest_of_mask(), names);
  return out;
}

// Rows with a constant value.
class PlainRows : public PixelRows {
 public:
  PlainRows(int w, int h, int c, float value) : PixelRows(w, h, c), value_(value) {}
  void next(float* row) override { std::fill_n(row, row_size(), value_); }

 private:
  float value_;
};

// Calls `work` with the rows of the picture and the mask.
template <class Work>
auto with_rows(const Image& picture, const Image* mask, const Work& work) {
  const Image none;
  ImageRows pixels(picture), masks(mask ? *mask : none);
  return work(pixels, mask ? &masks : nullptr);
}

// The undistorted camera that sees exactly the window.
Camera pinhole(const Camera& camera, const Window& window) {
  Camera out = camera;
  out.distortion = {};
  out.width = window.size;
  out.height = window.height();
  const double scale = window.size / window.side;
  out.fx = camera.fx * scale;
  out.fy = camera.fy * scale;
  out.cx = (camera.cx - window.x0) * scale;
  out.cy = (camera.cy - window.y0) * scale;
  return out;
}

}  // namespace

PreparedView on_white(FramedView view, bool masked) {
  PreparedView out{on_white(view.image), std::move(view.camera), Image(view.image.width, view.image.height, 1), masked};
  for (std::size_t i = 0; i < out.alpha.data.size(); ++i) out.alpha.data[i] = view.image.data[4 * i + 3];
  const auto opaque = [](float alpha) { return alpha >= 1; };
  if (std::all_of(out.alpha.data.begin(), out.alpha.data.end(), opaque)) out.alpha = {};
  return out;
}

Crop crop_from_name(const std::string& name) {
  if (name == "auto") return Crop::automatic;
  if (name == "object") return Crop::object;
  if (name == "crop") return Crop::crop;
  if (name == "pad") return Crop::pad;
  fail(Status::usage, "crop {}: auto, object, crop or pad is expected", name);
}

FramedView frame_view(const Camera& listed, PixelRows& picture, PixelRows* mask, const Framing& framing,
                      const PictureNames& names) {
  if (framing.size < 1) fail(Status::internal, "frame_view: size {}", framing.size);
  const Camera camera = checked(listed, picture, mask, names);
  const Window window = find_window(camera, framing, names);
  return {seen_through(picture, mask, window, camera, names), pinhole(camera, window)};
}

namespace {

// 1 for the window's pixels of which more than `least` is covered: by what the lens shows and, if given, by `part`.
Image covered(const Camera& camera, const Window& window, PixelRows* part, float least) {
  PlainRows everywhere(camera.width, camera.height, 4, 1.0f);
  PremultipliedRows source(everywhere, part);
  const Image shares = seen_through(source, window, camera);
  Image out(shares.width, shares.height, 1);
  for (std::size_t i = 0; i < out.data.size(); ++i) out.data[i] = shares.data[4 * i + 3] > least ? 1.0f : 0.0f;
  return out;
}

}  // namespace

WholeView whole_view(const Camera& listed, PixelRows& picture, PixelRows* mask, int longest, const PictureNames& names,
                     PixelRows* part) {
  const Camera camera = checked(listed, picture, mask, names);
  const int longer = std::max(picture.width, picture.height);
  const double step = longest > 0 && longer > longest ? static_cast<double>(longer) / longest : 1.0;
  // Partly covered pixels at the border are dropped.
  const auto pixels = [&](int length) { return std::max(static_cast<int>(std::floor(length / step + 1e-9)), 1); };
  const int columns = pixels(picture.width);
  const Window window{0, 0, columns * step, columns, pixels(picture.height)};
  WholeView out;
  out.camera = pinhole(camera, window);
  // What is known comes first: it takes as much memory as the picture while it is found.
  if (!is_pinhole(camera.distortion)) out.known = covered(camera, window, nullptr, 0.999f);
  if (part) {
    const Image inside = covered(camera, window, part, 0.9f);
    if (out.known.empty()) out.known = Image(inside.width, inside.height, 1, 1.0f);
    for (std::size_t i = 0; i < inside.data.size(); ++i) out.known.data[i] *= inside.data[i];
  }
  out.image = seen_through(picture, mask, window, camera, names);
  return out;
}

FramedView frame_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing) {
  const std::string name = camera.file.empty() ? "the picture" : camera.file;
  return with_rows(picture, mask, [&](PixelRows& pixels, PixelRows* masks) {
    return frame_view(camera, pixels, masks, framing, {name, "the mask of " + name});
  });
}

PreparedView prepare_view(const Camera& camera, const Image& picture, const Image* mask, const Framing& framing) {
  return on_white(frame_view(camera, picture, mask, framing), mask || picture.channels == 4);
}

WholeView whole_view(const Camera& camera, const Image& picture, const Image* mask, int longest,
                     const PictureNames& names) {
  return with_rows(picture, mask, [&](PixelRows& pixels, PixelRows* masks) {
    return whole_view(camera, pixels, masks, longest, names);
  });
}

PreparedView prepare_view(const Camera& camera, const std::string& picture_path, const std::string& mask_path,
                          const Framing& framing) {
  const Image picture = read_image(picture_path);
  const Image mask = mask_path.empty() ? Image() : read_mask(mask_path);
  return with_rows(picture, mask_path.empty() ? nullptr : &mask, [&](PixelRows& pixels, PixelRows* masks) {
    return on_white(frame_view(camera, pixels, masks, framing, {picture_path, mask_path}),
                    masks || picture.channels == 4);
  });
}

}  // namespace vsplat
