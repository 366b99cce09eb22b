#include "model/io/views/transforms_json.h"

#include <fmt/format.h>

#include <array>
#include <set>

#include "model/base/scene.h"
#include "model/io/views/listed_file.h"
#include "model/io/views/view_checks.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// Fields of a frame, which override those of the file.
class Fields {
 public:
  Fields(const json& root, const json& frame, std::string where)
      : root_(root), frame_(frame), where_(std::move(where)) {}

  const std::string& where() const { return where_; }
  bool in_frame(const char* name) const { return present(frame_, name); }
  const json* find(const char* name) const {
    if (present(frame_, name)) return &frame_.at(name);
    return present(root_, name) ? &root_.at(name) : nullptr;
  }
  double number_or(const char* name, double otherwise) const {
    const json* value = find(name);
    return value ? number(where_, name, *value) : otherwise;
  }
  std::string text_or(const char* name, const char* otherwise) const {
    const json* value = find(name);
    if (!value) return otherwise;
    if (!value->is_string()) fail(Status::format, "{}: {} is {}, a text is expected", where_, name, excerpt(*value));
    return value->get<std::string>();
  }
  bool flag(const char* name) const {
    const json* value = find(name);
    if (!value) return false;
    if (!value->is_boolean())
      fail(Status::format, "{}: {} is {}, true or false is expected", where_, name, excerpt(*value));
    return value->get<bool>();
  }

 private:
  static bool present(const json& object, const char* name) {
    const auto at = object.find(name);
    return at != object.end() && !at->is_null();
  }

  const json& root_;
  const json& frame_;
  std::string where_;
};

double angle_or_nan(const Fields& fields, const char* name) {
  const double angle = fields.number_or(name, nan);
  if (!std::isnan(angle) && !(angle > 1e-4 && angle < 3.14))
    fail(Status::input, "{}: {} is {}, an angle between 0 and pi (radians) is expected", fields.where(), name, angle);
  return angle;
}

// LaRa's Google Scanned Objects: an intrinsic matrix for pictures of 512 x 512.
void read_intrinsic_matrix(const Fields& fields, const json& value, Camera& camera) {
  const Eigen::Matrix3d k = matrix<3, 3>(fields.where(), "intrinsic_matrix", value);
  if (k(0, 1) != 0 || k.bottomLeftCorner<2, 1>() != Eigen::Vector2d::Zero() || k.row(2) != Eigen::RowVector3d(0, 0, 1))
    fail(Status::input, "{}: intrinsic_matrix is {}; focal lengths, a principal point and nothing else is expected",
         fields.where(), excerpt(value));
  camera.fx = k(0, 0), camera.fy = k(1, 1), camera.cx = k(0, 2), camera.cy = k(1, 2);
  if (camera.width == 0) camera.width = 512;
  if (camera.height == 0) camera.height = 512;
}

// fl_x and fl_y override angles, but a frame's own angle overrides the file's fl_, because it is specific to that
// frame.
void read_focal_lengths(const Fields& fields, ListedView& view) {
  Camera& camera = view.camera;
  const bool own_angle = (fields.in_frame("camera_angle_x") || fields.in_frame("camera_angle_y")) &&
                         !fields.in_frame("fl_x") && !fields.in_frame("fl_y");
  camera.fx = own_angle ? nan : fields.number_or("fl_x", nan);
  camera.fy = own_angle ? nan : fields.number_or("fl_y", nan);
  if (std::isnan(camera.fx)) camera.fx = camera.fy;
  if (std::isnan(camera.fy)) camera.fy = camera.fx;
  if (!std::isnan(camera.fx)) return;
  view.angle_x = angle_or_nan(fields, "camera_angle_x");
  view.angle_y = angle_or_nan(fields, "camera_angle_y");
  if (std::isnan(view.angle_x) && std::isnan(view.angle_y))
    fail(Status::format, "{}: has no focal length: one of fl_x, fl_y, camera_angle_x, camera_angle_y is expected",
         fields.where());
}

void read_distortion(const Fields& fields, Camera& camera) {
  for (const char* name : {"ftheta_p0", "latlong", "equirectangular"})
    if (const json* value = fields.find(name); value && !(value->is_boolean() && !value->get<bool>()))
      fail(Status::input, "{}: the lens model of {} is not supported; undistort the pictures first", fields.where(),
           name);
  static const std::set<std::string> perspective = {"OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"};
  std::string model = fields.text_or("camera_model", "OPENCV");
  for (char& c : model) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  const bool fisheye = model == "OPENCV_FISHEYE" || fields.flag("is_fisheye");
  if (!fisheye && perspective.count(model) == 0)
    fail(Status::input,
         "{}: camera_model \"{}\" is not supported (OPENCV, OPENCV_FISHEYE and PINHOLE are); undistort the pictures "
         "first",
         fields.where(), printable(model));
  std::array<double, 6> k{};
  const char* const names[] = {"k1", "k2", "k3", "k4", "p1", "p2"};
  if (const json* all = fields.find("distortion_params"); all && !all->is_null()) {  // nerfstudio's other spelling
    const auto one = matrix<1, 6>(fields.where(), "distortion_params", json::array({*all}));
    for (int i = 0; i < 6; ++i) k[i] = one(0, i);
  } else {
    for (int i = 0; i < 6; ++i) k[i] = fields.number_or(names[i], 0.0);
  }
  Distortion& out = camera.distortion;
  if (fisheye) {
    if (k[4] != 0 || k[5] != 0)
      fail(Status::input, "{}: p1 and p2 of a fisheye lens are not supported; undistort the pictures first",
           fields.where());
    out.model = Distortion::Model::fisheye;
    for (int i = 0; i < 4; ++i) out.k[i] = k[i];
    return;
  }
  // k4 is the coefficient of r^8 here, which OpenCV's rational model lacks.
  if (k[3] != 0)
    fail(Status::input, "{}: k4 of a perspective lens is not supported; undistort the pictures first", fields.where());
  if (k == std::array<double, 6>{}) return;
  out.model = Distortion::Model::opencv;
  out.k[0] = k[0], out.k[1] = k[1], out.k[2] = k[4], out.k[3] = k[5], out.k[4] = k[2];
}

Eigen::Matrix4d read_pose(const Fields& fields, const json& frame) {
  const auto at = frame.find("transform_matrix");
  if (at == frame.end()) fail(Status::format, "{}: has no transform_matrix", fields.where());
  if (at->is_null()) fail(Status::format, "{}: transform_matrix is null: the frame has no pose", fields.where());
  Eigen::Matrix4d c2w = Eigen::Matrix4d::Identity();
  if (at->is_array() && at->size() == 3) {
    c2w.topRows<3>() = matrix<3, 4>(fields.where(), "transform_matrix", *at);
  } else {
    c2w = matrix<4, 4>(fields.where(), "transform_matrix", *at);
  }
  c2w = checked_rigid(fields.where(), "transform_matrix", c2w);
  c2w.middleCols<2>(1) *= -1;  // OpenGL axes to OpenCV axes
  return rigid_inverse(c2w);
}

void read_frame(ListedView& view, const std::filesystem::path& path, const json& root, const json& frame,
                std::size_t index, bool need_pictures) {
  const std::string numbered = fmt::format("{}: frame {}", path.string(), index);
  if (!frame.is_object()) fail(Status::format, "{}: is {}, an object is expected", numbered, excerpt(frame));
  if (const auto at = frame.find("file_path"); at != frame.end() && at->is_string()) view.name = at->get<std::string>();
  // In LaRa's Google Scanned Objects the frame's index names the picture, regardless of file_path.
  const std::string numbered_name = fmt::format("r_{:03}.png", index);
  if (std::error_code ignored; frame.contains("intrinsic_matrix") &&
                               std::filesystem::is_regular_file(path.parent_path() / numbered_name, ignored))
    view.name = numbered_name;
  const bool named = !view.name.empty() && view.name.find('\0') == std::string::npos;
  if (!named && (need_pictures || frame.contains("file_path")))
    fail(Status::format, "{}: file_path is {}, the picture's path is expected", numbered,
         frame.contains("file_path") ? excerpt(frame.at("file_path")) : "absent");
  const Fields fields(root, frame, named ? fmt::format("{} ({})", numbered, printable(view.name)) : numbered);
  Camera& camera = view.camera;
  camera.file = view.name;
  if (fields.find("w")) camera.width = picture_side(fields.where(), "w", fields.number_or("w", 0));
  if (fields.find("h")) camera.height = picture_side(fields.where(), "h", fields.number_or("h", 0));
  camera.cx = fields.number_or("cx", nan);
  camera.cy = fields.number_or("cy", nan);
  if (const json* k = fields.find("intrinsic_matrix")) {
    read_intrinsic_matrix(fields, *k, camera);
  } else {
    read_focal_lengths(fields, view);
  }
  read_distortion(fields, camera);
  camera.w2c = read_pose(fields, frame);
  if (fields.in_frame("mask_path")) {
    const std::string mask = fields.text_or("mask_path", "");
    if (mask.find('\0') != std::string::npos) fail(Status::format, "{}: mask_path is no path", fields.where());
    if (!mask.empty()) view.mask = mask;
  }
  if (fields.in_frame("depth_file_path")) {
    const std::string depth = fields.text_or("depth_file_path", "");
    if (depth.find('\0') != std::string::npos) fail(Status::format, "{}: depth_file_path is no path", fields.where());
    view.depth = depth;
  }
  check_intrinsics(fields.where(), camera);
}

// nerfstudio's lists of the pictures in each part.
void read_splits(const std::string& where, const json& root, std::vector<ListedView>& views) {
  for (const auto& [name, split] : {std::pair{"train_filenames", Split::train}, std::pair{"val_filenames", Split::val},
                                    std::pair{"test_filenames", Split::test}}) {
    const auto at = root.find(name);
    if (at == root.end() || at->is_null()) continue;
    if (!at->is_array()) fail(Status::format, "{}: {} is {}, a list is expected", where, name, excerpt(*at));
    std::set<std::string> files;
    for (const json& file : *at) {
      if (!file.is_string()) fail(Status::format, "{}: {} holds {}, texts are expected", where, name, excerpt(file));
      files.insert(std::filesystem::path(file.get<std::string>()).lexically_normal().string());
    }
    for (ListedView& view : views)
      if (files.count(std::filesystem::path(view.name).lexically_normal().string()) != 0) view.split = split;
  }
}

}  // namespace

ViewSet parse_transforms_json(const std::filesystem::path& path, const json& root, bool need_pictures) {
  ViewSet out;
  out.source = path;
  out.convention = PoseConvention::opengl_c2w;
  const std::string where = path.string();
  if (const auto at = root.find("aabb_center"); at != root.end() && !at->is_null()) {
    out.aabb_center = vector3(where, "aabb_center", *at);
    if (out.aabb_center->cwiseAbs().maxCoeff() > kFarthestOffset)
      fail(Status::input, "{}: aabb_center is {}, a place at most {} from the origin is expected", where, excerpt(*at),
           kFarthestOffset);
  }
  if (const auto at = root.find("aabb_half"); at != root.end() && !at->is_null()) {
    out.aabb_half = number(where, "aabb_half", *at);
    constexpr double least = 1e-12;
    if (!(*out.aabb_half >= least && *out.aabb_half <= kFarthestOffset))
      fail(Status::input, "{}: aabb_half is {}, a number between {} and {} is expected", where, *out.aabb_half, least,
           kFarthestOffset);
  }
  if (const auto at = root.find("depth_unit_scale_factor"); at != root.end() && !at->is_null()) {
    out.depth_unit = number(where, "depth_unit_scale_factor", *at);
    if (!(*out.depth_unit > 0))
      fail(Status::input, "{}: depth_unit_scale_factor is {}, a number above 0 is expected", where, *out.depth_unit);
  }
  if (const auto at = root.find("ply_file_path"); at != root.end() && !at->is_null()) {
    const std::string points = at->is_string() ? at->get<std::string>() : std::string(1, '\0');
    if (points.find('\0') != std::string::npos)
      fail(Status::format, "{}: ply_file_path is {}, the path of a PLY file with points is expected", where,
           excerpt(*at));
    if (!points.empty()) {
      const std::filesystem::path folder = path.parent_path();
      out.points = ListedFiles({folder}, folder).find_with_ending(points);
      if (out.points.empty()) out.points = folder / points;  // and reading it tells that it is missing
    }
  }
  const json& frames = root.at("frames");
  if (!frames.is_array()) fail(Status::format, "{}: frames is {}, a list is expected", where, excerpt(frames));
  if (frames.empty()) fail(Status::input, "{}: lists no frames", where);
  out.views.reserve(frames.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ListedView& view = out.views.emplace_back();
    noting_problems(view, [&] { read_frame(view, path, root, frames[i], i, need_pictures); });
    out.lists_masks |= frames[i].is_object() && frames[i].contains("mask_path");
  }
  if (root.contains("mask_path")) {
    out.lists_masks = true;
    warn("{}: mask_path of the file as a whole is not used: each frame names its own", where);
  }
  read_splits(where, root, out.views);
  return out;
}

namespace {

// The field of view is vertical and in degrees.
void read_path_camera(ListedView& view, const std::string& where, const json& root, const json& pose) {
  if (!pose.is_object() || !pose.contains("camera_to_world")) fail(Status::format, "{}: has no camera_to_world", where);
  json rows = pose.at("camera_to_world");
  if (rows.is_array() && rows.size() == 16) {
    const json flat = rows;
    rows = json::array();
    for (std::size_t r = 0; r < 16; r += 4) rows.push_back({flat[r], flat[r + 1], flat[r + 2], flat[r + 3]});
  }
  Eigen::Matrix4d c2w = checked_rigid(where, "camera_to_world", matrix<4, 4>(where, "camera_to_world", rows));
  c2w.middleCols<2>(1) *= -1;  // OpenGL axes to OpenCV axes
  Camera& camera = view.camera;
  camera.w2c = rigid_inverse(c2w);
  const Fields fields(root, pose, where);
  if (fields.find("render_width"))
    camera.width = picture_side(where, "render_width", fields.number_or("render_width", 0));
  if (fields.find("render_height"))
    camera.height = picture_side(where, "render_height", fields.number_or("render_height", 0));
  camera.fx = camera.fy = camera.cx = camera.cy = nan;
  const double degrees = fields.number_or("fov", nan);
  if (!(degrees > 0.01 && degrees < 179))
    fail(Status::input, "{}: fov is {}, degrees between 0 and 179 are expected", where, degrees);
  view.angle_y = degrees * M_PI / 180;
}

}  // namespace

ViewSet parse_camera_path(const std::filesystem::path& path, const json& root) {
  ViewSet out;
  out.source = path;
  out.convention = PoseConvention::opengl_c2w;
  const std::string file = path.string();
  const json& poses = root.at("camera_path");
  if (!poses.is_array() || poses.empty())
    fail(Status::format, "{}: camera_path is {}, a list of cameras is expected", file, excerpt(poses));
  if (const auto type = root.find("camera_type"); type != root.end() && *type != "perspective")
    fail(Status::input, "{}: camera_type is {}, only perspective can be drawn", file, excerpt(*type));
  for (std::size_t i = 0; i < poses.size(); ++i) {
    ListedView& view = out.views.emplace_back();
    noting_problems(view, [&] { read_path_camera(view, fmt::format("{}: camera {}", file, i), root, poses[i]); });
  }
  return out;
}

}  // namespace vsplat
