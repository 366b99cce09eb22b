#include "model/io/views/colmap.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <string_view>

#include "model/io/any_case.h"
#include "model/io/views/colmap_file.h"
#include "model/io/views/view_checks.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

struct Model {
  const char* name;
  int params;              // -1: unknown
  const char* names = "";  // names of the parameters; "": not supported
};

// Indexed by COLMAP's model_id.
constexpr Model models[] = {{"SIMPLE_PINHOLE", 3, "f cx cy"},
                            {"PINHOLE", 4, "fx fy cx cy"},
                            {"SIMPLE_RADIAL", 4, "f cx cy k"},
                            {"RADIAL", 5, "f cx cy k1 k2"},
                            {"OPENCV", 8, "fx fy cx cy k1 k2 p1 p2"},
                            {"OPENCV_FISHEYE", 8, "fx fy cx cy k1 k2 k3 k4"},
                            {"FULL_OPENCV", 12, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"},
                            {"FOV", 5},
                            {"SIMPLE_RADIAL_FISHEYE", 4, "f cx cy k"},
                            {"RADIAL_FISHEYE", 5, "f cx cy k1 k2"},
                            {"THIN_PRISM_FISHEYE", 12},
                            {"RAD_TAN_THIN_PRISM_FISHEYE", 16},
                            {"SIMPLE_DIVISION", -1},
                            {"DIVISION", -1},
                            {"SIMPLE_FISHEYE", -1},
                            {"FISHEYE", -1},
                            {"EUCM", -1},
                            {"EQUIRECTANGULAR", -1}};
constexpr int model_count = static_cast<int>(std::size(models));
constexpr int max_params = 16;

const Model& known_model(const std::string& where, int id) {
  if (id < 0 || id >= model_count) fail(Status::format, "{}: camera model {} is not one of COLMAP's", where, id);
  return models[id];
}

void need_supported(const std::string& where, const Model& model) {
  if (*model.names == '\0')
    fail(Status::input,
         "{}: camera model {} is not supported; undistort the pictures with COLMAP's image_undistorter first", where,
         model.name);
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
    std::copy_n(q + 2, count, c.distortion.k);  // our order is COLMAP's: k1 k2 p1 p2 k3 k4 k5 k6, or k1 k2 k3 k4
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

// A camera, or the reason why it cannot be used; the reason only matters if an image uses the camera.
struct ListedCamera {
  Camera camera;
  std::string problem = {};
  Status status = Status::input;
};
using Cameras = std::map<std::uint32_t, ListedCamera>;

void add_camera(Cameras& cameras, const std::string& where, std::uint32_t id, const std::function<Camera()>& read) {
  ListedView made;
  noting_problems(made, [&] { made.camera = read(); });
  if (!cameras.emplace(id, ListedCamera{made.camera, made.problem, made.problem_status}).second)
    fail(Status::format, "{}: camera {} is there twice", where, id);
}

// Sets the camera and pose of a view that already has its name.
void complete_view(ListedView& view, const std::string& where, const Cameras& cameras, std::uint32_t camera_id,
                   const double* pose) {
  const auto at = cameras.find(camera_id);
  if (at == cameras.end()) fail(Status::format, "{}: camera {} is not in the file of cameras", where, camera_id);
  const ListedCamera& listed = at->second;
  if (!listed.problem.empty()) fail(listed.status, "{}, which {} is taken with", listed.problem, printable(view.name));
  view.camera = listed.camera;
  view.camera.file = view.name;
  view.camera.w2c = make_pose(where, pose);
}

Cameras read_cameras_binary(const fs::path& path) {
  ColmapBytes in(path);
  Cameras out;
  const std::uint64_t n = in.count("cameras", 24);
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto id = in.read<std::uint32_t>("a camera's id");
    const std::string where = fmt::format("{}: camera {}", in.path(), id);
    const auto model_id = in.read<std::int32_t>("a camera's model");
    const Model& model = known_model(where, model_id);
    if (model.params < 0) need_supported(where, model);  // the start of the next camera is unknown
    const auto width = in.read<std::uint64_t>("a camera's width"), height = in.read<std::uint64_t>("a camera's height");
    double p[max_params];
    for (int k = 0; k < model.params; ++k) p[k] = in.read<double>("a camera's parameter");
    add_camera(out, where, id, [&] {
      need_supported(where, model);
      return make_camera(where, model_id, static_cast<double>(width), static_cast<double>(height), p);
    });
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
    ListedView& view = out.emplace_back();
    view.colmap_image = id;
    view.name = view.camera.file = in.text("an image's name");
    in.skip(24 * in.count("points", 24));
    const std::string where = fmt::format("{}: image {} ({})", in.path(), id, printable(view.name));
    noting_problems(view, [&] { complete_view(view, where, cameras, camera_id, pose); });
  }
  in.end();
  return out;
}

Camera read_camera_line(ColmapLines& in, const std::string& where) {
  const std::string_view name = in.word();
  const auto* const model =
      std::find_if(std::begin(models), std::end(models), [&](const Model& m) { return name == m.name; });
  if (model == std::end(models))
    fail(Status::format, "{}: camera model \"{}\" is not one of COLMAP's", where, printable(name));
  need_supported(where, *model);
  const auto width = in.value<double>("WIDTH"), height = in.value<double>("HEIGHT");
  double p[max_params];
  for (int k = 0; k < model->params; ++k) {
    if (in.rest().empty())
      fail(Status::format,
           "{}: {} has the {} parameters {}, and the line ends after {} of them: a number is expected; write 0 for a "
           "coefficient that is not known",
           where, model->name, model->params, model->names, k);
    p[k] = in.value<double>("a parameter");
  }
  if (!in.rest().empty())
    fail(Status::format, "{}: more than the {} parameters of {}: {}", where, model->params, model->name, model->names);
  return make_camera(where, static_cast<int>(model - models), width, height, p);
}

Cameras read_cameras_text(const fs::path& path) {
  ColmapLines in(path);
  Cameras out;
  while (in.record_line()) {
    const auto id = in.value<std::uint32_t>("CAMERA_ID");
    const std::string where = fmt::format("{} (camera {})", in.where(), id);
    add_camera(out, where, id, [&] { return read_camera_line(in, where); });
  }
  return out;
}

// Otherwise the next image would be read as points, and every other image would be lost.
void check_points_line(ColmapLines& in) {
  const auto refuse = [&](const std::string& found) {
    fail(Status::format,
         "{}: the line after an image holds its points, X Y POINT3D_ID each, or is empty; this one {}: every image's "
         "line needs such a line after it, an empty one if the image has no points",
         in.where(), found);
  };
  long words = 0;
  for (std::string_view word = in.word(); !word.empty(); word = in.word(), ++words) {
    double value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    const bool whole = words % 3 != 2 || value == std::floor(value);
    if (end != word.data() + word.size() || !whole)
      refuse(fmt::format("has \"{}\" where {} is expected", printable(word),
                         words % 3 == 2 ? "a whole number" : "a number"));
  }
  if (words % 3 != 0) refuse(fmt::format("has {} words", words));
}

std::vector<ListedView> read_images_text(const fs::path& path, const Cameras& cameras) {
  ColmapLines in(path);
  std::vector<ListedView> out;
  while (in.record_line()) {
    ListedView& view = out.emplace_back();
    noting_problems(view, [&] {
      const auto id = in.value<std::uint32_t>("IMAGE_ID");
      view.colmap_image = id;
      double pose[7];
      for (double& v : pose) v = in.value<double>("the pose");
      const auto camera_id = in.value<std::uint32_t>("CAMERA_ID");
      const std::string name(in.rest());
      if (name.empty() || name.find('\0') != std::string::npos)
        fail(Status::format, "{}: NAME is missing or no name", in.where());
      view.name = view.camera.file = name;
      complete_view(view, fmt::format("{} (image {}, {})", in.where(), id, printable(name)), cameras, camera_id, pose);
    });
    if (!in.any_line()) break;
    check_points_line(in);
  }
  return out;
}

// In upper or lower case, since some programs write Cameras.txt.
fs::path file_of(const fs::path& folder, const char* what, const char* extension) {
  return in_any_case(folder, fmt::format("{}.{}", what, extension));
}

bool holds(const fs::path& folder, const char* extension) {
  std::error_code error;
  return fs::is_regular_file(file_of(folder, "cameras", extension), error) &&
         fs::is_regular_file(file_of(folder, "images", extension), error);
}

}  // namespace

bool is_colmap_model(const fs::path& folder) { return holds(folder, "bin") || holds(folder, "txt"); }

std::uint64_t images_in(const fs::path& folder) {
  try {
    if (holds(folder, "bin")) return ColmapBytes(file_of(folder, "images", "bin")).read<std::uint64_t>("images");
    ColmapLines in(file_of(folder, "images", "txt"));
    std::uint64_t count = 0;
    for (; in.record_line(); ++count) in.any_line();
    return count;
  } catch (const Error&) {
    return 0;  // reading the model reports the error
  }
}

// The model with the most images among `folder`'s numbered subfolders, where COLMAP stores the components that it could
// not join; otherwise the model in the folder itself.
ColmapChoice largest_of(const fs::path& folder) {
  std::map<long, fs::path> parts;
  std::error_code error;
  // In other folders, numbered subfolders may be the objects of a data set.
  const std::string own = lower_case(fs::absolute(folder, error).lexically_normal().filename().string());
  const bool may_have_parts = own == "sparse" || own == "colmap";
  for (fs::directory_iterator at(folder, error), end; may_have_parts && !error && at != end; at.increment(error)) {
    const std::string name = at->path().filename().string();
    long number = 0;
    const auto [last, problem] = std::from_chars(name.data(), name.data() + name.size(), number);
    if (problem == std::errc() && last == name.data() + name.size() && is_colmap_model(at->path()))
      parts.emplace(number, folder / name);
  }
  ColmapChoice out;
  std::uint64_t most = 0;
  std::string others;
  for (const auto& [number, part] : parts) {
    const std::uint64_t count = parts.size() > 1 ? images_in(part) : 1;
    others += fmt::format("{}{} with {}", others.empty() ? "" : ", ", part.string(), count);
    if (out.folder.empty() || count > most) out.folder = part, most = count;
  }
  if (parts.size() > 1)
    out.reason =
        fmt::format("{}: chosen from {} COLMAP models, since it has the most pictures ({}); name another to use it",
                    out.folder.string(), parts.size(), others);
  if (parts.empty() && is_colmap_model(folder)) out.folder = folder;
  return out;
}

ColmapChoice choose_colmap_model(const fs::path& folder) {
  const fs::path colmap = in_any_case(folder, "colmap");
  std::vector<fs::path> places = {in_any_case(folder, "sparse"), colmap, in_any_case(colmap, "sparse"), folder};
  std::error_code error;
  const fs::path dense =
      in_any_case(folder, "dense");  // image_undistorter writes dense/sparse, some scripts dense/0/sparse
  std::vector<fs::path> numbered;
  for (fs::directory_iterator at(dense, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().find_first_not_of("0123456789") == std::string::npos)
      numbered.push_back(dense / at->path().filename() / "sparse");
  std::sort(numbered.begin(), numbered.end());
  places.insert(places.end(), {dense / "sparse"});
  places.insert(places.end(), numbered.begin(), numbered.end());
  places.push_back(folder / "distorted/sparse");
  ColmapChoice out;
  for (const fs::path& place : places) {
    ColmapChoice found = largest_of(place);
    if (found.folder.empty()) continue;
    if (out.folder.empty()) {
      out = std::move(found);
    } else {
      out.reason += fmt::format("{}{}: this COLMAP model is read; {} is another", out.reason.empty() ? "" : "; ",
                                out.folder.string(), found.folder.string());
      break;
    }
  }
  return out;
}

fs::path find_colmap_model(const fs::path& folder) { return choose_colmap_model(folder).folder; }

ViewSet read_colmap(const fs::path& folder) {
  const bool binary = holds(folder, "bin");
  if (!binary && !holds(folder, "txt"))
    fail(Status::file, "{}: no COLMAP model: cameras.bin and images.bin, or the two as .txt, are expected",
         folder.string());
  ViewSet out;
  out.source = folder;
  out.convention = PoseConvention::opencv_w2c;
  if (binary) {
    if (holds(folder, "txt"))
      out.choices.push_back(
          fmt::format("{}: cameras.bin and images.bin are read, not the .txt files", folder.string()));
    out.views =
        read_images_binary(file_of(folder, "images", "bin"), read_cameras_binary(file_of(folder, "cameras", "bin")));
  } else {
    out.views =
        read_images_text(file_of(folder, "images", "txt"), read_cameras_text(file_of(folder, "cameras", "txt")));
  }
  if (out.views.empty()) fail(Status::input, "{}: the COLMAP model lists no images", folder.string());
  std::stable_sort(out.views.begin(), out.views.end(),
                   [](const ListedView& a, const ListedView& b) { return a.name < b.name; });
  return out;
}

}  // namespace vsplat
