// Posed views of every format.
#include <Eigen/LU>
#include <cmath>

#include "model/base/lens.h"
#include "model/io/views/colmap_points.h"
#include "model/io/views/view_set.h"
#include "tests/fuzz/targets.h"
#include "tests/support/temporary.h"

namespace vsplat::fuzz {
namespace {

void check_lens(const Distortion& distortion) {
  for (const double k : distortion.k) hold(std::abs(k) <= 1e6, "a coefficient is one of a lens");
  const Lens lens(distortion, 2);
  for (const double x : {0.0, 0.3, 1.9}) {
    double u = 0, v = 0;
    if (lens.distort(x, -0.4 * x, u, v)) hold(std::isfinite(u) && std::isfinite(v), "a ray's place is finite");
  }
}

void check(const ViewSet& set) {
  hold(!set.views.empty(), "there are views");
  for (std::size_t i = 0; i < set.views.size() && i < 8; ++i) {
    ListedView view = set.views[i];
    const Eigen::Matrix4d& m = view.camera.w2c;
    const Eigen::Matrix3d r = m.topLeftCorner<3, 3>();
    hold(m.allFinite() && (r * r.transpose()).isIdentity(1e-6) && r.determinant() > 0, "a pose is rigid");
    hold(view.camera.centre().allFinite(), "a centre is finite");
    check_lens(view.camera.distortion);
    if (is_resolved(view)) continue;
    try {
      resolve_intrinsics(view, 640, 480);
    } catch (const Error& e) {
      hold(e.status() == Status::input, "the size does not fit");
      continue;
    }
    hold(is_resolved(view) && view.camera.fx > 0 && view.camera.fy > 0, "resolved");
  }
}

void read(const std::string& path) {
  try {
    check(read_views(path, {.need_pictures = false}));
  } catch (const Error& e) {
    hold_message(e, path);
  }
}

// A folder whose four COLMAP files are in memory.
class ColmapFolder {
 public:
  ColmapFolder() { set(true); }

  std::string path() const { return folder_.path(); }
  void fill(bool binary, std::string_view camera_bytes, std::string_view image_bytes) {
    if (binary != binary_) set(binary);
    cameras.fill(camera_bytes);
    images.fill(image_bytes);
  }

 private:
  void set(bool binary) {
    namespace fs = std::filesystem;
    for (const char* ending : {".bin", ".txt"})
      for (const char* name : {"/cameras", "/images"}) fs::remove(path() + name + ending);
    fs::create_symlink(cameras.path(), path() + (binary ? "/cameras.bin" : "/cameras.txt"));
    fs::create_symlink(images.path(), path() + (binary ? "/images.bin" : "/images.txt"));
    binary_ = binary;
  }

  test::TemporaryFolder folder_;
  MemoryFile cameras, images;
  bool binary_ = true;
};

// A folder with a COLMAP model for tests of its points.
class PointsFolder {
 public:
  PointsFolder() {
    for (const char* name : {"/cameras.bin", "/images.bin"})
      std::filesystem::create_symlink(empty.path(), path() + name);
  }

  std::string path() const { return folder_.path(); }
  void fill(bool binary, std::string_view bytes) {
    namespace fs = std::filesystem;
    for (const char* name : {"/points3D.bin", "/points3D.txt"}) fs::remove(path() + name);
    points.fill(bytes);
    fs::create_symlink(points.path(), path() + (binary ? "/points3D.bin" : "/points3D.txt"));
  }

 private:
  test::TemporaryFolder folder_;
  MemoryFile empty, points;
};

}  // namespace

void views_json(std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  read(file.path());
}

void colmap(std::string_view bytes) {
  static ColmapFolder folder;
  if (bytes.empty()) return;
  const std::string_view rest = bytes.substr(1);
  const std::size_t split = std::min(rest.find(kColmapSplit), rest.size());
  folder.fill(bytes[0] == 'b', rest.substr(0, split), rest.substr(std::min(split + kColmapSplit.size(), rest.size())));
  read(folder.path());
}

void colmap_points(std::string_view bytes) {
  static PointsFolder folder;
  if (bytes.empty()) return;
  folder.fill(bytes[0] == 'b', bytes.substr(1));
  try {
    const std::vector<ColoredPoint> points = read_colmap_points(folder.path());
    hold(!points.empty() && points.size() <= bytes.size(), "there are points, no more than the file has room for");
    for (const ColoredPoint& point : points) {
      hold(point.position.allFinite() && point.position.cast<float>().allFinite(), "positions are finite");
      hold(std::isfinite(point.error) && point.track <= bytes.size(), "error and track are usable");
    }
  } catch (const Error& e) {
    hold_message(e, folder.path());
  }
}

}  // namespace vsplat::fuzz
