#include "model/data/object_folder.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "model/data/ray_tracer.h"
#include "model/data/sphere_cameras.h"
#include "model/io/picture/image_file.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/files/staged_folder.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// Whether we wrote this file in an object's folder, in this or an earlier run with more views.
bool is_ours(const std::string& inside) {
  if (inside == "transforms.json") return true;
  const auto digit = [&](std::size_t i) { return inside[i] >= '0' && inside[i] <= '9'; };
  return inside.size() == 15 && inside.starts_with("images/") && inside.ends_with(".png") && digit(7) && digit(8) &&
         digit(9) && digit(10);
}

ordered_json frame(const Camera& camera) {
  Eigen::Matrix4d c2w = camera.c2w();
  c2w.middleCols<2>(1) *= -1;  // OpenCV axes to OpenGL axes
  ordered_json rows = ordered_json::array();
  for (int r = 0; r < 4; ++r) rows.push_back({c2w(r, 0), c2w(r, 1), c2w(r, 2), c2w(r, 3)});
  return {{"file_path", camera.file}, {"transform_matrix", rows}};
}

std::string transforms(const std::vector<Camera>& cameras) {
  const Camera& c = cameras.front();
  ordered_json out = {{"camera_model", "PINHOLE"},
                      {"w", c.width},
                      {"h", c.height},
                      {"fl_x", c.fx},
                      {"fl_y", c.fy},
                      {"cx", c.cx},
                      {"cy", c.cy},
                      {"aabb_center", {0.0, 0.0, 0.0}},
                      {"aabb_half", 0.5},
                      {"frames", ordered_json::array()}};
  for (const Camera& camera : cameras) out["frames"].push_back(frame(camera));
  return out.dump(1) + "\n";
}

}  // namespace

std::vector<std::string> object_files(const std::string& folder, int views) {
  std::vector<std::string> out;
  out.reserve(static_cast<std::size_t>(views) + 1);
  for (int i = 0; i < views; ++i) out.push_back((fs::path(folder) / fmt::format("images/{:04d}.png", i)).string());
  out.push_back((fs::path(folder) / "transforms.json").string());
  return out;
}

void write_object(const std::string& folder, Mesh mesh, const ObjectOptions& options) {
  StagedFolder staged(folder);
  fit_into_cube(mesh);
  const std::vector<Camera> cameras =
      sphere_cameras(options.views, options.size, radius_of(mesh), options.seed, options.object);
  const RayTracer tracer(mesh);
  const std::vector<std::string> files = object_files(staged.path().string(), options.views);
  std::error_code problem;
  fs::create_directory(staged.path() / "images", problem);
  if (problem) fail(Status::file, "{}: the folder cannot be made: {}", folder, problem.message());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (options.go && !options.go(static_cast<double>(i) / static_cast<double>(cameras.size())))
      fail(Status::cancelled, "stopped");
    write_png(files[i], tracer.picture(cameras[i]));
  }
  const std::string text = transforms(cameras);
  write_file(files.back(), text.data(), text.size());
  staged.put_in_place(is_ours);
}

}  // namespace vsplat
