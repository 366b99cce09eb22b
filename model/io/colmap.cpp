#include "model/io/colmap.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <map>
#include <string_view>

#include "model/io/colmap_file.h"
#include "model/io/view_checks.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

struct Model {
  const char* name;
  int params;  // 0: not supported
};

// By COLMAP's model_id.
constexpr Model models[] = {{"SIMPLE_PINHOLE", 3},
                            {"PINHOLE", 4},
                            {"SIMPLE_RADIAL", 4},
                            {"RADIAL", 5},
                            {"OPENCV", 8},
                            {"OPENCV_FISHEYE", 8},
                            {"FULL_OPENCV", 12},
                            {"FOV", 0},
                            {"SIMPLE_RADIAL_FISHEYE", 4},
                            {"RADIAL_FISHEYE", 5},
                            {"THIN_PRISM_FISHEYE", 0},
                            {"RAD_TAN_THIN_PRISM_FISHEYE", 0},
                            {"SIMPLE_DIVISION", 0},
                            {"DIVISION", 0},
                            {"SIMPLE_FISHEYE", 0},
                            {"FISHEYE", 0},
                            {"EUCM", 0},
                            {"EQUIRECTANGULAR", 0}};
constexpr int model_count = static_cast<int>(std::size(models));
constexpr int max_params = 12;

const Model& supported_model(const std::string& where, int id) {
  if (id < 0 || id >= model_count) fail(Status::format, "{}: camera model {} is not one of COLMAP's", where, id);
  if (models[id].params == 0)
    fail(Status::input,
         "{}: camera model {} is not supported; undistort the pictures with COLMAP's image_undistorter first", where,
         models[id].name);
  return models[id];
}

Camera make_camera(const std::string& where, int model_id, double width, double height, const double* p) {
  Camera c;
  c.width = picture_side(where, "WIDTH", width);
  c.height = picture_side(where, "HEIGHT", height);
  const bool one_focal = model_id == 0 || model_id == 2 || model_id == 3 || model_id == 8 || model_id == 9;
  c.fx = p[0];
  c.fy = one_focal ? p[0] : p[1];
  const double* q = p + (one_focal ? 1 : 2);
  c.cx = q[0], c.cy = q[1];
  const int count = models[model_id].params - (one_focal ? 3 : 4);
  for (int i = 0; i < models[model_id].params; ++i)
    if (!std::isfinite(p[i]))
      fail(Status::input, "{}: parameter {} is {}, a finite number is expected", where, i, p[i]);
  if (count > 0) {
    const bool fisheye = model_id == 5 || model_id == 8 || model_id == 9;
    c.distortion.model = fisheye ? Distortion::Model::fisheye : Distortion::Model::opencv;
    std::copy_n(q + 2, count, c.distortion.k);  // COLMAP's order is ours: k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4
  }
  check_intrinsics(where, c);
  return c;
}

Eigen::Matrix4d make_pose(const std::string& where, const double* v) {
  constexpr const char* names[] = {"QW", "QX", "QY", "QZ", "TX", "TY", "TZ"};
  for (int i = 0; i < 7; ++i)
    if (!std::isfinite(v[i])) fail(Status::input, "{}: {} is {}, a finite number is expected", where, names[i], v[i]);
  const Eigen::Quaterniond q(v[0], v[1], v[2], v[3]);
  if (std::abs(q.norm() - 1) > 1e-3)
    fail(Status::input, "{}: the rotation's quaternion has length {:.6g}, 1 is expected", where, q.norm());
  Eigen::Matrix4d w2c = Eigen::Matrix4d::Identity();
  w2c.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
  w2c.topRightCorner<3, 1>() << v[4], v[5], v[6];
  return checked_rigid(where, "the pose", w2c);
}

using Cameras = std::map<std::uint32_t, Camera>;

void add_camera(Cameras& cameras, const std::string& where, std::uint32_t id, const Camera& camera) {
  if (!cameras.emplace(id, camera).second) fail(Status::format, "{}: camera {} is there twice", where, id);
}

ListedView make_view(const std::string& where, const Cameras& cameras, std::uint32_t camera_id, const std::string& name,
                     const double* pose) {
  const auto at = cameras.find(camera_id);
  if (at == cameras.end()) fail(Status::format, "{}: camera {} is not in the file of cameras", where, camera_id);
  ListedView view;
  view.camera = at->second;
  view.camera.w2c = make_pose(where, pose);
  view.name = view.camera.file = name;
  return view;
}

Cameras read_cameras_binary(const fs::path& path) {
  ColmapBytes in(path);
  Cameras out;
  const std::uint64_t n = in.count("cameras", 24);
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto id = in.read<std::uint32_t>("a camera's id");
    const std::string where = fmt::format("{}: camera {}", in.path(), id);
    const auto model_id = in.read<std::int32_t>("a camera's model");
    const int params = supported_model(where, model_id).params;
    const auto width = in.read<std::uint64_t>("a camera's width"), height = in.read<std::uint64_t>("a camera's height");
    double p[max_params];
    for (int k = 0; k < params; ++k) p[k] = in.read<double>("a camera's parameter");
    add_camera(out, where, id,
               make_camera(where, model_id, static_cast<double>(width), static_cast<double>(height), p));
  }
  in.end();
  return out;
}

std::vector<ListedView> read_images_binary(const fs::path& path, const Cameras& cameras) {
  ColmapBytes in(path);
  std::vector<ListedView> out;
  const std::uint64_t n = in.count("images", 4 + 7 * 8 + 4 + 2 + 8);
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto id = in.read<std::uint32_t>("an image's id");
    double pose[7];
    for (double& v : pose) v = in.read<double>("an image's pose");
    const auto camera_id = in.read<std::uint32_t>("an image's camera");
    const std::string name = in.text("an image's name");
    in.skip(24 * in.count("points", 24));
    out.push_back(
        make_view(fmt::format("{}: image {} ({})", in.path(), id, printable(name)), cameras, camera_id, name, pose));
  }
  in.end();
  return out;
}

Cameras read_cameras_text(const fs::path& path) {
  ColmapLines in(path);
  Cameras out;
  while (in.record_line()) {
    const auto id = in.value<std::uint32_t>("CAMERA_ID");
    const std::string where = fmt::format("{} (camera {})", in.where(), id);
    const std::string_view name = in.word();
    const auto* const model =
        std::find_if(std::begin(models), std::end(models), [&](const Model& m) { return name == m.name; });
    if (model == std::end(models))
      fail(Status::format, "{}: camera model \"{}\" is not one of COLMAP's", where, printable(name));
    const int model_id = static_cast<int>(model - models);
    supported_model(where, model_id);
    const auto width = in.value<double>("WIDTH"), height = in.value<double>("HEIGHT");
    double p[max_params];
    for (int k = 0; k < model->params; ++k) p[k] = in.value<double>("a parameter");
    if (!in.rest().empty())
      fail(Status::format, "{}: more than the {} parameters of {}", where, model->params, model->name);
    add_camera(out, where, id, make_camera(where, model_id, width, height, p));
  }
  return out;
}

std::vector<ListedView> read_images_text(const fs::path& path, const Cameras& cameras) {
  ColmapLines in(path);
  std::vector<ListedView> out;
  while (in.record_line()) {
    const auto id = in.value<std::uint32_t>("IMAGE_ID");
    double pose[7];
    for (double& v : pose) v = in.value<double>("the pose");
    const auto camera_id = in.value<std::uint32_t>("CAMERA_ID");
    const std::string name(in.rest());
    if (name.empty() || name.find('\0') != std::string::npos)
      fail(Status::format, "{}: NAME is missing or no name", in.where());
    out.push_back(
        make_view(fmt::format("{} (image {}, {})", in.where(), id, printable(name)), cameras, camera_id, name, pose));
    if (!in.any_line()) break;
    long words = 0;
    while (!in.word().empty()) ++words;
    if (words % 3 != 0)  // else the next image would be taken for points, and every other one lost
      fail(Status::format,
           "{}: the line after an image holds its points, X Y POINT3D_ID each, or is empty; this one has {} words",
           in.where(), words);
  }
  return out;
}

bool holds(const fs::path& folder, const char* extension) {
  std::error_code error;
  return fs::is_regular_file(folder / fmt::format("cameras.{}", extension), error) &&
         fs::is_regular_file(folder / fmt::format("images.{}", extension), error);
}

}  // namespace

bool is_colmap_model(const fs::path& folder) { return holds(folder, "bin") || holds(folder, "txt"); }

fs::path find_colmap_model(const fs::path& folder) {
  for (const char* name : {"sparse/0", "sparse", "colmap"})
    if (is_colmap_model(folder / name)) return folder / name;
  return is_colmap_model(folder) ? folder : fs::path();
}

ViewSet read_colmap(const fs::path& folder) {
  const bool binary = holds(folder, "bin");
  if (!binary && !holds(folder, "txt"))
    fail(Status::file, "{}: no COLMAP model: cameras.bin and images.bin, or the two as .txt, are expected",
         folder.string());
  ViewSet out;
  out.source = folder;
  out.convention = PoseConvention::opencv_w2c;
  if (binary) {
    out.views = read_images_binary(folder / "images.bin", read_cameras_binary(folder / "cameras.bin"));
  } else {
    out.views = read_images_text(folder / "images.txt", read_cameras_text(folder / "cameras.txt"));
  }
  if (out.views.empty()) fail(Status::input, "{}: the COLMAP model lists no images", folder.string());
  std::stable_sort(out.views.begin(), out.views.end(),
                   [](const ListedView& a, const ListedView& b) { return a.name < b.name; });
  return out;
}

}  // namespace vsplat
