#include "model/io/views/cameras_json.h"

#include <fmt/format.h>

#include <iterator>

#include "model/io/views/view_checks.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

using nlohmann::json;

const json& field(const std::string& where, const json& entry, const char* name) {
  const auto at = entry.find(name);
  if (at == entry.end()) fail(Status::format, "{}: has no {}", where, name);
  return *at;
}

std::string file_name(const std::string& where, const json& entry, const char* name, bool needed) {
  const auto at = entry.find(name);
  if (at == entry.end() && !needed) return "";
  const json& value = field(where, entry, name);
  if (!value.is_string() || (needed && value.get_ref<const std::string&>().empty()) ||
      value.get_ref<const std::string&>().find('\0') != std::string::npos)
    fail(Status::format, "{}: {} is {}, the picture's path is expected", where, name, excerpt(value));
  return value.get<std::string>();
}

ListedView read_ours(const std::string& where, const json& entry) {
  ListedView view;
  Camera& c = view.camera;
  const auto value = [&](const char* name) { return number(where, name, field(where, entry, name)); };
  c.width = picture_side(where, "w", value("w"));
  c.height = picture_side(where, "h", value("h"));
  c.fx = value("fx"), c.fy = value("fy"), c.cx = value("cx"), c.cy = value("cy");
  c.w2c = checked_rigid(where, "w2c", matrix<4, 4>(where, "w2c", field(where, entry, "w2c")));
  return view;
}

ListedView read_inria(const std::string& where, const json& entry) {
  ListedView view;
  Camera& c = view.camera;
  const auto value = [&](const char* name) { return number(where, name, field(where, entry, name)); };
  c.width = picture_side(where, "width", value("width"));
  c.height = picture_side(where, "height", value("height"));
  c.fx = value("fx"), c.fy = value("fy");
  c.cx = 0.5 * c.width, c.cy = 0.5 * c.height;
  Eigen::Matrix4d c2w = Eigen::Matrix4d::Identity();
  c2w.topLeftCorner<3, 3>() = matrix<3, 3>(where, "rotation", field(where, entry, "rotation"));
  c2w.topRightCorner<3, 1>() = vector3(where, "position", field(where, entry, "position"));
  c.w2c = rigid_inverse(checked_rigid(where, "rotation and position", c2w));
  return view;
}

// Reads the name first, so that it is known even if the rest is unusable.
void read_entry(ListedView& view, std::string where, const json& entry, bool inria, bool need_pictures) {
  if (!entry.is_object()) fail(Status::format, "{}: is {}, an object is expected", where, excerpt(entry));
  if (!inria && !entry.contains("w2c")) fail(Status::format, "{}: has neither w2c nor position and rotation", where);
  view.name = view.camera.file = file_name(where, entry, inria ? "img_name" : "file", need_pictures);
  if (!view.name.empty()) where += " (" + printable(view.name) + ")";
  const std::string name = view.name;
  view = inria ? read_inria(where, entry) : read_ours(where, entry);
  view.name = view.camera.file = name;
  check_intrinsics(where, view.camera);
}

}  // namespace

ViewSet parse_cameras_json(const std::filesystem::path& path, const json& root, bool need_pictures) {
  if (!root.is_array()) fail(Status::format, "{}: is {}, a list of cameras is expected", path.string(), excerpt(root));
  if (root.empty()) fail(Status::input, "{}: lists no cameras", path.string());
  ViewSet out;
  out.source = path;
  for (std::size_t i = 0; i < root.size(); ++i) {
    ListedView view;
    const bool inria =
        root[i].is_object() && !root[i].contains("w2c") && root[i].contains("position") && root[i].contains("rotation");
    noting_problems(
        view, [&] { read_entry(view, fmt::format("{}: camera {}", path.string(), i), root[i], inria, need_pictures); });
    if (inria) out.convention = PoseConvention::opencv_position;
    out.views.push_back(std::move(view));
  }
  return out;
}

void write_cameras(const std::filesystem::path& path, const std::vector<Camera>& cameras) {
  std::string text = "[";
  auto to = std::back_inserter(text);
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& c = cameras[i];
    if (c.distortion.model != Distortion::Model::none)
      fail(Status::internal, "{}: camera {} ({}) has lens distortion, which the format cannot hold", path.string(), i,
           c.file);
    for (const double v : {c.fx, c.fy, c.cx, c.cy, c.w2c.sum()})
      if (!std::isfinite(v)) fail(Status::internal, "{}: camera {} ({}) is not finite", path.string(), i, c.file);
    const std::string file = json(c.file).dump(-1, ' ', false, json::error_handler_t::replace);
    fmt::format_to(to,
                   "{}\n {{\"file\": {}, \"w\": {}, \"h\": {}, \"fx\": {:.17g}, \"fy\": {:.17g}, \"cx\": {:.17g}, "
                   "\"cy\": {:.17g},\n  \"w2c\": [",
                   i ? "," : "", file, c.width, c.height, c.fx, c.fy, c.cx, c.cy);
    for (int r = 0; r < 4; ++r)
      fmt::format_to(to, "{}[{:.17g}, {:.17g}, {:.17g}, {:.17g}]", r ? ", " : "", c.w2c(r, 0), c.w2c(r, 1), c.w2c(r, 2),
                     c.w2c(r, 3));
    text += "]}";
  }
  text += "\n]\n";
  write_file(path.string(), text.data(), text.size());
}

}  // namespace vsplat
