// Posed views from files: transforms.json (NeRF, instant-ngp, nerfstudio), COLMAP models, our own cameras.json and that
// of the INRIA viewers. Every reader converts to OpenCV world-to-camera matrices in the user's world. The matrices are
// used as listed: `applied_transform` and `applied_scale` describe their origin and are not undone.
#pragma once
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "runtime/error.h"

namespace vsplat {

// How the file states a pose; used to guess what an implausible pose was meant to be.
enum class PoseConvention {
  opengl_c2w,       // transforms.json: camera-to-world, x right, y up, -z forward
  opencv_w2c,       // COLMAP and our cameras.json: world-to-camera, x right, y down, z forward
  opencv_position,  // INRIA's cameras.json: centre in the world, camera-to-world rotation, OpenCV axes
  opencv_c2w        // LaRa's HDF5 files: camera-to-world, OpenCV axes
};

// The part of a set that a view belongs to, if the set has parts.
enum class Split { none, train, val, test };

// One camera of a file. Values that depend on a picture size which the file does not give stay unknown until
// resolve_intrinsics(): width or height 0, cx or cy NaN, and fx, fy NaN if only fields of view are given.
struct ListedView {
  Camera camera;
  std::string name;                           // as listed
  std::filesystem::path picture;              // empty if there is no such file
  std::optional<std::filesystem::path> mask;  // black is background; its existence is checked on use
  std::filesystem::path depth = {};  // a picture of depth, "" if none is listed; its existence is checked on use
  Split split = Split::none;
  std::uint32_t colmap_image = 0;  // IMAGE_ID, for a COLMAP model
  std::string problem = {};        // why the view cannot be used; its camera is then meaningless, and it has no picture
  Status problem_status = Status::input;
  double angle_x = std::numeric_limits<double>::quiet_NaN(), angle_y = angle_x;  // fields of view in radians, or NaN
};

struct ViewSet {
  std::vector<ListedView> views;  // every frame as listed (COLMAP: sorted by name), with or without a picture
  std::optional<Eigen::Vector3d> aabb_center;
  std::optional<double> aabb_half;
  std::filesystem::path source;  // the file, or the COLMAP model's folder
  PoseConvention convention = PoseConvention::opencv_w2c;
  std::filesystem::path points = {};  // a PLY file of sparse points (ply_file_path of transforms.json), or ""
  bool lists_masks = false;           // the list itself names masks
  std::optional<double> depth_unit;   // of depth pictures in the world's unit of length (depth_unit_scale_factor)
  bool leaves_out_bad = false;        // set for BadViews::leave_out
  // For messages, "" if there is nothing to report: the first missing picture's name in the list and where it was
  // searched for, how many masks were found, and the choices among several files.
  std::string first_missing = {}, looked_for = {}, masks_found = {};
  std::vector<std::string> choices = {};
};

// How to treat views that cannot be used: an invalid pose or camera, or a missing mask.
enum class BadViews {
  refuse,     // the first bad view is an error, even if it would not be used
  keep,       // ListedView::problem describes it; using the view throws that error
  leave_out,  // as keep, and one warning counts them; an error if none is left
};

struct ReadOptions {
  std::filesystem::path pictures_dir = {};  // where the pictures are, if not in the format's usual place
  bool need_pictures =
      true;  // one warning counts frames without a picture; an error if none has one. False: target cameras
  bool use_pictures = true;                       // false: a picture in a forbidden place counts as missing
  std::vector<std::filesystem::path> roots = {};  // further folders in which pictures and masks may lie
  BadViews bad = BadViews::refuse;
  bool all_splits = false;  // read all of transforms_train.json, _val and _test, otherwise only the first
  bool tell = true;         // report choices among several files as information, otherwise only in verbose output
};

// `path`: a file or folder as for read_view_list(); "-" is the standard input. Error(file) if it does not exist, or if
// a picture or mask lies outside the cameras' folder, COLMAP's pictures and the folders of the options
// (runtime/files/roots.h). Error(format) if the content is damaged. Error(input) if a pose or an intrinsic is invalid
// (not finite, singular, mirrored, scaled, a focal length not positive), or as for find_view_files().
ViewSet read_views(const std::filesystem::path& path, const ReadOptions& options = {});

// Whether read_views() would find cameras in this folder; checks only names.
bool holds_views(const std::filesystem::path& folder);

// Throws the view's problem, if it has one.
void need_good(const ListedView& view);

// Computes the unknown values from the size of the view's picture (or, for a target camera, of the picture to draw). If
// the file lists another size of the same aspect ratio (within a pixel), the picture was resized, and the intrinsics
// are scaled accordingly; Error(input) for another aspect ratio.
void resolve_intrinsics(ListedView& view, int width, int height);

// Whether width, height and all intrinsics are known.
bool is_resolved(const ListedView& view);

}  // namespace vsplat
