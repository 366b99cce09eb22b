// Posed views from files: transforms.json (NeRF, instant-ngp, nerfstudio), COLMAP models, our own cameras.json and that
// of the INRIA viewers. Every reader maps into OpenCV world-to-camera matrices in the user's own world; the matrices
// are taken as listed (`applied_transform` and `applied_scale` describe how they came about and are not undone).
#pragma once
#include <cmath>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "runtime/error.h"

namespace vsplat {

// How the file states a pose; what a mistaken one was probably meant to be follows from it.
enum class PoseConvention {
  opengl_c2w,       // transforms.json: camera-to-world, x right, y up, -z forward
  opencv_w2c,       // COLMAP and our cameras.json: world-to-camera, x right, y down, z forward
  opencv_position,  // INRIA's cameras.json: centre in the world, camera-to-world rotation, OpenCV axes
  opencv_c2w        // LaRa's HDF5 files: camera-to-world, OpenCV axes
};

// Which part of a set a view belongs to, where the set has parts.
enum class Split { none, train, val, test };

// One camera of a file. What depends on a picture's size that the file does not give stays open until
// resolve_intrinsics(): width or height 0, cx or cy NaN, and fx, fy NaN where only fields of view are given.
struct ListedView {
  Camera camera;
  std::string name;               // as listed
  std::filesystem::path picture;  // empty where there is no such file
  std::optional<std::filesystem::path>
      mask;  // black is not the object; whether the file exists is found when it is used
  Split split = Split::none;
  std::string problem = {};  // why it cannot be used: its camera means nothing then, and it has no picture
  Status problem_status = Status::input;
  double angle_x = std::numeric_limits<double>::quiet_NaN(), angle_y = angle_x;  // fields of view in radians, or NaN
};

struct ViewSet {
  std::vector<ListedView> views;  // every frame, as listed (COLMAP: in order of name), with a picture or without
  std::optional<Eigen::Vector3d> aabb_center;
  std::optional<double> aabb_half;
  std::filesystem::path source;  // the file, or the COLMAP model's folder
  PoseConvention convention = PoseConvention::opencv_w2c;
  std::filesystem::path points = {};  // a PLY file of sparse points (ply_file_path of transforms.json); "" for none
  bool lists_masks = false;           // the list itself says which views have a mask
  bool leaves_out_bad = false;        // of BadViews::leave_out
  // For messages, "" where there is nothing to say: where a picture that is missing was looked for, how many masks
  // were found, and what was chosen of several.
  std::string looked_for = {}, masks_found = {};
  std::vector<std::string> choices = {};
};

// What becomes of views that cannot be used: a pose that is none, a camera of no use, a mask that is missing.
enum class BadViews {
  refuse,     // the first of them is an error, also where nobody would use it
  keep,       // ListedView::problem tells of it; who uses the view throws it
  leave_out,  // the same, and one warning counts them; an error where none is left
};

struct ReadOptions {
  std::filesystem::path pictures_dir = {};  // where the pictures are, if not where the format has them
  bool need_pictures =
      true;  // one warning counts the frames that have none; none left is an error. False: target cameras
  bool use_pictures = true;                       // false: one that lies where none may be read is as good as none
  std::vector<std::filesystem::path> roots = {};  // folders in which pictures and masks may lie besides their own
  BadViews bad = BadViews::refuse;
  bool all_splits = false;  // of transforms_train.json, _val and _test all that there are, else the first
  bool tell = true;         // choices among several files are told as information, else to who wants to know all
};

// `path`: one of the files, or a folder, as read_view_list() takes them; "-" is the standard input. Error(file) where
// there is none, or where a picture or mask lies outside the cameras' folder, COLMAP's pictures and those of the
// options (runtime/files/roots.h), Error(format) where its content is damaged, Error(input) where a pose or an intrinsic is
// of no use (not finite, singular, mirrored, scaled, a focal length not positive), or as find_view_files() has it.
ViewSet read_views(const std::filesystem::path& path, const ReadOptions& options = {});

// Whether read_views() finds cameras in this folder; nothing is read but names.
bool holds_views(const std::filesystem::path& folder);

// Throws the problem of a view that has one.
void need_good(const ListedView& view);

// Fills in what was left open from the size of the view's picture (or of the picture to draw, for a target camera).
// Where the file lists another size of the same shape (within a pixel), the picture was resized, and the intrinsics
// are scaled with it; Error(input) for another shape.
void resolve_intrinsics(ListedView& view, int width, int height);

// Whether width, height and all intrinsics are known.
bool is_resolved(const ListedView& view);

}  // namespace vsplat
