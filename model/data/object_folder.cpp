#include "model/data/object_folder.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "model/data/ray_tracer.h"
#include "model/data/sphere_cameras.h"
#include "model/io/image_file.h"
#include "runtime/fail.h"
#include "runtime/file.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

// Files and folders made so far, taken away again unless kept.
class Made {
 public:
  Made() = default;
  Made(const Made&) = delete;
  Made& operator=(const Made&) = delete;
  ~Made() {
    std::error_code ignored;
    for (auto path = paths_.rbegin(); path != paths_.rend(); ++path) fs::remove(*path, ignored);
  }
  void folder(const fs::path& path) {
    std::error_code problem;
    if (path.empty() || fs::is_directory(path, problem)) return;
    folder(path.parent_path());
    if (!fs::create_directory(path, problem) && problem)
      fail(Status::file, "{}: the folder cannot be made: {}", path.string(), problem.message());
    paths_.push_back(path);
  }
  void file(const fs::path& path) { paths_.push_back(path); }
  void keep() { paths_.clear(); }

 private:
  std::vector<fs::path> paths_;
};

ordered_json frame(const Camera& camera) {
  Eigen::Matrix4d c2w = camera.c2w();
  c2w.middleCols<2>(1) *= -1;  // OpenCV's axes to OpenGL's
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
  fit_into_cube(mesh);
  const std::vector<Camera> cameras =
      sphere_cameras(options.views, options.size, radius_of(mesh), options.seed, options.object);
  const RayTracer tracer(mesh);
  const std::vector<std::string> files = object_files(folder, options.views);
  std::error_code problem;
  fs::remove(files.back(), problem);
  if (problem) fail(Status::file, "{}: cannot be replaced: {}", files.back(), problem.message());
  Made made;
  made.folder(fs::path(files.front()).parent_path());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (options.go && !options.go(static_cast<double>(i) / static_cast<double>(cameras.size())))
      fail(Status::cancelled, "stopped");
    const Image picture = tracer.picture(cameras[i]);
    made.file(files[i]);
    write_png(files[i], picture);
  }
  made.file(files.back());
  const std::string text = transforms(cameras);
  write_file(files.back(), text.data(), text.size());
  made.keep();
}

}  // namespace vsplat
