#include "model/views/pose_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "model/base/lens.h"
#include "model/views/auto_frame.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

double depth(const Camera& camera, const Eigen::Vector3d& point) {
  return camera.w2c.row(2).head<3>().dot(point - camera.centre());
}

struct Seen {
  int behind = 0, outside = 0;
  int missed() const { return behind + outside; }
};

Seen look(std::span<const Camera> cameras, const Eigen::Vector3d& point) {
  Seen out;
  for (const Camera& c : cameras) {
    const auto at = project_to_picture(c, point);
    if (!(depth(c, point) > 0)) {
      ++out.behind;
    } else if (!(at && at->x() >= 0 && at->x() <= c.width && at->y() >= 0 && at->y() <= c.height)) {
      ++out.outside;
    }
  }
  return out;
}

struct Swap {
  const char* text;
  Camera (*apply)(const Camera&);
};

Camera with_c2w(const Camera& camera, const Eigen::Matrix4d& c2w) {
  Camera out = camera, inverse;
  inverse.w2c = c2w;
  out.w2c = inverse.c2w();  // rigid inverse of w2c
  return out;
}

Eigen::Matrix4d flipped(Eigen::Matrix4d c2w) {  // negates the camera's y and z axes
  c2w.middleCols<2>(1) *= -1;
  return c2w;
}

// With L the listed matrix and D = diag(1,-1,-1,1): transforms.json is read as c2w = L D, the OpenCV formats as c2w =
// L^-1.
Camera other_axes(const Camera& c) { return with_c2w(c, flipped(c.c2w())); }
Camera inverted_opengl(const Camera& c) { return with_c2w(c, flipped(with_c2w(c, flipped(c.c2w())).w2c)); }  // L^-1 D
Camera inverted_opengl_axes(const Camera& c) { return with_c2w(c, with_c2w(c, flipped(c.c2w())).w2c); }      // L^-1
Camera inverted_opencv(const Camera& c) { return with_c2w(c, c.w2c); }                // L; with L = c2w, L^-1
Camera inverted_opencv_axes(const Camera& c) { return with_c2w(c, flipped(c.w2c)); }  // L D; with L = c2w, L^-1 D
Camera turned_back(const Camera& c) {  // transposes the rotation, keeps the centre
  Eigen::Matrix4d c2w = c.c2w();
  c2w.topLeftCorner<3, 3>().transposeInPlace();
  return with_c2w(c, c2w);
}
Camera turned_back_axes(const Camera& c) { return other_axes(turned_back(c)); }

std::vector<Swap> possible_swaps(PoseConvention convention) {
  switch (convention) {
    case PoseConvention::opengl_c2w:
      return {
          {"OpenCV axes (y down, z forward) where the file's format has OpenGL axes (y up, -z forward)", other_axes},
          {"world-to-camera matrices (w2c) where the file's format has camera-to-world (c2w)", inverted_opengl},
          {"world-to-camera matrices (w2c) with OpenCV axes where the file's format has camera-to-world (c2w) with "
           "OpenGL axes",
           inverted_opengl_axes}};
    case PoseConvention::opencv_w2c:
      return {
          {"OpenGL axes (y up, -z forward) where the file's format has OpenCV axes (y down, z forward)", other_axes},
          {"camera-to-world matrices (c2w) where the file's format has world-to-camera (w2c)", inverted_opencv},
          {"camera-to-world matrices (c2w) with OpenGL axes where the file's format has world-to-camera (w2c) with "
           "OpenCV axes",
           inverted_opencv_axes}};
    case PoseConvention::opencv_c2w:
      return {
          {"OpenGL axes (y up, -z forward) where the file's format has OpenCV axes (y down, z forward)", other_axes},
          {"world-to-camera matrices (w2c) where the file's format has camera-to-world (c2w)", inverted_opencv},
          {"world-to-camera matrices (w2c) with OpenGL axes where the file's format has camera-to-world (c2w) with "
           "OpenCV axes",
           inverted_opencv_axes}};
    default:
      return {
          {"OpenGL axes (y up, -z forward) where the file's format has OpenCV axes (y down, z forward)", other_axes},
          {"world-to-camera rotations (w2c) where the file's format has camera-to-world (c2w)", turned_back},
          {"world-to-camera rotations (w2c) with OpenGL axes where the file's format has camera-to-world (c2w) with "
           "OpenCV axes",
           turned_back_axes}};
  }
}

std::vector<Camera> after(const Swap& swap, std::span<const Camera> cameras) {
  std::vector<Camera> out;
  out.reserve(cameras.size());
  for (const Camera& c : cameras) out.push_back(swap.apply(c));
  return out;
}

// The mean angle by which the optical axes miss their common point, in degrees; 180 if they have no common point, as
// when all cameras are at one place.
double degrees_off(std::span<const Camera> cameras) {
  const std::optional<Eigen::Vector3d> point = where_axes_meet(cameras);
  if (!point) return 180;
  double sum = 0, nearest = std::numeric_limits<double>::infinity(), apart = 0;
  for (const Camera& c : cameras) {
    const Eigen::Vector3d to = *point - c.centre(), axis = c.w2c.row(2).head<3>();
    nearest = std::min(nearest, to.norm());
    apart = std::max(apart, (c.centre() - cameras[0].centre()).norm());
    sum += std::atan2(axis.cross(to).norm(), axis.dot(to));
  }
  const bool is_among_them = nearest < 1e-3 * apart || apart < 1e-9 * std::max(1e-9, cameras[0].centre().norm());
  return is_among_them ? 180 : sum / static_cast<double>(cameras.size()) * 180 / M_PI;
}

void warn_of_one_place(const std::string& set, std::span<const Camera> cameras) {
  if (cameras.size() < 2) return;
  double apart = 0, turned = 0, far = 0;
  for (const Camera& c : cameras) {
    apart = std::max(apart, (c.centre() - cameras[0].centre()).norm());
    turned = std::max(turned, (c.w2c - cameras[0].w2c).topLeftCorner<3, 3>().cwiseAbs().maxCoeff());
    far = std::max(far, c.centre().norm());
  }
  // A thousandth of the distance is a pixel of parallax in a picture of a thousand. In the coordinates of a map, where
  // the distance from the origin tells nothing, the tolerance only covers rounding.
  constexpr double map = 1e4, parallax = 1e-3, rounding = 1e-9;
  if (apart > (far < map ? parallax : rounding) * std::max(far, rounding)) return;
  if (turned < parallax)
    warn(
        "{}: all {} views have nearly the same pose, so distances cannot be found. If an object turned in front of a "
        "fixed "
        "camera, the poses must be those of the camera relative to the object: COLMAP finds them if masks or a plain "
        "background hide what did not turn",
        set, cameras.size());
  else
    warn(
        "{}: all {} cameras are nearly at one place and only turned, so distances cannot be found: pictures from "
        "several "
        "places are needed",
        set, cameras.size());
}

// A principal point outside the picture is what a crop far off the middle has, too, so it is no error.
void warn_of_principal_points(const std::string& set, std::span<const Camera> cameras) {
  const auto is_outside = [](const Camera& c) { return c.cx < 0 || c.cy < 0 || c.cx > c.width || c.cy > c.height; };
  const auto first = std::find_if(cameras.begin(), cameras.end(), is_outside);
  if (first == cameras.end()) return;
  warn(
      "{}: the principal point (cx, cy) of {} of {} views lies outside the picture; the first: {} has ({:.6g}, {:.6g}) "
      "in a picture of {} x {}. Unless the pictures are crops, correct the file: the values are in pixels",
      set, std::count_if(first, cameras.end(), is_outside), cameras.size(), first->file, first->cx, first->cy,
      first->width, first->height);
}

}  // namespace

std::optional<Eigen::Vector2d> project_to_picture(const Camera& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = camera.w2c.topLeftCorner<3, 3>() * (point - camera.centre());
  if (!(p.z() > 0)) return std::nullopt;
  double x = p.x() / p.z(), y = p.y() / p.z();
  if (!is_pinhole(camera.distortion) && !Lens(camera.distortion, std::hypot(x, y)).distort(x, y, x, y))
    return std::nullopt;
  return Eigen::Vector2d(camera.fx * x + camera.cx, camera.fy * y + camera.cy);
}

void check_centre_is_seen(std::span<const Camera> cameras, PoseConvention convention, const ChosenPlacement& chosen,
                          std::optional<bool> force) {
  const Eigen::Vector3d& centre = chosen.placement.centre;
  const Seen seen = look(cameras, centre);
  if (seen.missed() == 0) {
    if (const std::string better = chosen.moves_with_poses ? poses_that_meet(cameras, convention) : ""; !better.empty())
      warn("{}", better);
    return;
  }
  std::string text = fmt::format(
      "the centre of the object's cube {}{} is behind {} and outside the picture of {} of {} views", to_text(centre),
      chosen.centre_from.empty() ? "" : " (" + chosen.centre_from + ")", seen.behind, seen.outside, cameras.size());
  std::string swaps;
  for (const Swap& swap : possible_swaps(convention)) {
    const std::vector<Camera> swapped = after(swap, cameras);
    const std::optional<Eigen::Vector3d> point = chosen.moves_with_poses ? where_axes_meet(swapped) : centre;
    if (point && look(swapped, *point).missed() == 0)
      swaps += fmt::format("{}{}", swaps.empty() ? "" : ", or ", swap.text);
  }
  if (!swaps.empty() && chosen.moves_with_poses) {
    text += fmt::format(
        ": the axes of the cameras do not meet in front of them. They would if the poses were meant as {}: correct the "
        "poses",
        swaps);
  } else if (!swaps.empty()) {
    text += fmt::format("; it would be in the picture of all if the poses were meant as {}: correct the poses", swaps);
  } else {
    text += fmt::format(
        "; no swap of axes or of directions puts it into all of them: give {} and {}, or {}, which estimates them "
        "even if the list has others",
        Option::center, Option::scale, Option::auto_frame);
  }
  if (2 * seen.missed() > static_cast<int>(cameras.size()) && !force.value_or(false))
    fail(Status::input, "{}{}", text, force ? fmt::format(" ({} continues regardless)", Option::force) : "");
  warn("{}", text);
}

std::string poses_that_meet(std::span<const Camera> cameras, PoseConvention convention) {
  constexpr double well = 5, badly = 10, better = 0.25;  // degrees, and times as much
  if (cameras.size() < 3) return "";
  const double as_listed = degrees_off(cameras);
  if (as_listed < badly) return "";
  std::string swaps;
  double least = 180;
  for (const Swap& swap : possible_swaps(convention)) {
    const double off = degrees_off(after(swap, cameras));
    if (off > well || off > better * as_listed) continue;
    swaps += fmt::format("{}{}", swaps.empty() ? "" : ", or ", swap.text);
    least = std::min(least, off);
  }
  if (swaps.empty()) return "";
  return fmt::format(
      "the axes of the {} cameras do not meet in front of them: they pass the nearest point by {:.0f} degrees on "
      "average, and by {:.1f} if the poses were meant as {}: correct the poses if they were",
      cameras.size(), as_listed, least, swaps);
}

void warn_of_unlikely_cameras(const std::string& set, std::span<const Camera> cameras) {
  warn_of_one_place(set, cameras);
  warn_of_principal_points(set, cameras);
}

void check_cube_is_in_front(std::span<const Camera> cameras, const Placement& placement) {
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    const double nearest = c.w2c(2, 3) - 0.5 * c.w2c.row(2).head<3>().cwiseAbs().sum();
    if (nearest > 0) continue;
    const std::string advice =
        c.w2c(2, 3) > 0 ? fmt::format("; an edge ({}) under {:.4g} would leave it in front", Option::scale,
                                      placement.edge * c.w2c(2, 3) / (c.w2c(2, 3) - nearest))
                        : fmt::format("; its centre too: place it with {}, or leave this view out", Option::center);
    fail(Status::input,
         "view {} ({}): a corner of the object's cube, centre {} and edge {:.6g}, is behind the camera{}", i, c.file,
         to_text(placement.centre), placement.edge, advice);
  }
}

}  // namespace vsplat
