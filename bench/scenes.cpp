#include "bench/scenes.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "model/base/normal_quantile.h"
#include "model/base/rng.h"
#include "model/base/scene.h"
#include "model/io/scene/ply.h"
#include "model/io/views/view_set.h"
#include "runtime/fail.h"

namespace vsplat::bench {

namespace {

constexpr double kPi = 3.14159265358979323846;

// Random numbers of one element: equal on every machine, and independent of how many others drew.
class Draws {
 public:
  Draws(std::uint64_t seed, std::size_t element) : key_(rng_key(seed)), element_(static_cast<std::uint32_t>(element)) {}

  double uniform(double low, double high) { return low + (high - low) * static_cast<double>(uniform_open(bits())); }
  double normal(double mean, double deviation) {
    return mean + deviation * normal_quantile(static_cast<double>(uniform_open(bits())));
  }
  int below(int n) { return static_cast<int>(static_cast<double>(uniform01(bits())) * n); }

 private:
  std::uint32_t bits() {
    if (at_ == 4) {
      block_ = philox4x32_10({element_, step_++, 0, 0}, key_);
      at_ = 0;
    }
    return block_[at_++];
  }

  std::array<std::uint32_t, 2> key_;
  std::array<std::uint32_t, 4> block_{};
  std::uint32_t element_, step_ = 0;
  std::size_t at_ = 4;
};

void add(std::vector<float>& to, const Eigen::Vector3d& v) {
  for (int i = 0; i < 3; ++i) to.push_back(static_cast<float>(v[i]));
}

// What both scenes draw alike: opacity, rotation, and SH about a colour.
void add_looks(Gaussians& g, Draws& draws, double opacity_deviation, const Eigen::Vector3d& colour,
               double sh_deviation) {
  const double opacity = 1 / (1 + std::exp(-draws.normal(0.5, opacity_deviation)));
  g.opacities.push_back(static_cast<float>(std::clamp(opacity, 1e-4, 1 - 1e-4)));
  Eigen::Vector4d q;
  for (int i = 0; i < 4; ++i) q[i] = draws.normal(0, 1);
  q.normalize();
  for (int i = 0; i < 4; ++i) g.quats.push_back(static_cast<float>(q[i]));
  add(g.sh, (colour.array() - 0.5) / kShC0);
  for (std::size_t i = 3; i < 3 * g.sh_count(); ++i) g.sh.push_back(static_cast<float>(draws.normal(0, sh_deviation)));
}

// In a cube of side^3 voxels about the origin, edge 1, `per_voxel` in each of the `voxels` nearest to a sphere.
Gaussians shell(int side, std::size_t voxels, int per_voxel) {
  std::vector<Eigen::Vector3d> centres;
  const auto at = [side](int i) { return (i + 0.5) / side - 0.5; };
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j)
      for (int k = 0; k < side; ++k) centres.emplace_back(at(i), at(j), at(k));
  std::vector<std::size_t> order(centres.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto distance = [&](std::size_t i) { return std::abs(centres[i].norm() - 0.3); };
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return distance(a) < distance(b); });
  order.resize(voxels);
  std::sort(order.begin(), order.end());
  Gaussians g;
  g.sh_degree = 1;
  for (const std::size_t voxel : order) {
    for (int m = 0; m < per_voxel; ++m) {
      Draws draws(190, g.count++);
      Eigen::Vector3d mean = centres[voxel], scale;
      for (int i = 0; i < 3; ++i) mean[i] += draws.uniform(-0.375, 0.375) / side;
      for (int i = 0; i < 3; ++i) scale[i] = std::exp(draws.normal(-std::log(6.0 * side), 0.5));
      add(g.means, mean), add(g.scales, scale);
      const bool odd = static_cast<long>((mean * 8).array().floor().sum()) % 2 != 0;
      const Eigen::Vector3d red(0.9, 0.3, 0.2), blue(0.2, 0.4, 0.9);
      add_looks(g, draws, 2.0, odd ? red : blue, 0.05);
    }
  }
  return g;
}

// Half of them on hilly ground of 8 x 8, half on the walls of 40 boxes.
Gaussians slab(std::size_t count) {
  struct Box {
    Eigen::Vector3d centre, half;
  };
  std::vector<Box> boxes;
  for (std::size_t b = 0; b < 40; ++b) {
    Draws draws(1001, b);
    const double x = draws.uniform(-3.5, 3.5), y = draws.uniform(-3.5, 3.5), sx = draws.uniform(0.15, 0.5),
                 sy = draws.uniform(0.15, 0.5), sz = draws.uniform(0.15, 0.5);
    boxes.push_back({{x, y, 0.4}, {sx, sy, sz}});
  }
  Gaussians g;
  g.count = count;
  g.sh_degree = 3;
  g.sh.reserve(count * 48);
  for (std::size_t k = 0; k < count; ++k) {
    Draws draws(1000, k);
    Eigen::Vector3d mean, scale;
    if (draws.uniform(0, 1) < 0.5) {
      const Box& box = boxes[static_cast<std::size_t>(draws.below(40))];
      const int face = draws.below(3);
      for (int i = 0; i < 3; ++i) mean[i] = draws.uniform(-1, 1);
      mean[face] = mean[face] < 0 ? -1 : 1;
      mean = box.centre + mean.cwiseProduct(box.half);
    } else {
      mean.x() = draws.uniform(-4, 4), mean.y() = draws.uniform(-4, 4);
      mean.z() = 0.3 * std::sin(1.3 * mean.x()) * std::cos(1.7 * mean.y());
    }
    const double size = draws.normal(-4.6, 0.7);
    for (int i = 0; i < 3; ++i) scale[i] = std::exp(size + draws.normal(0, 0.5));
    add(g.means, mean), add(g.scales, scale);
    const Eigen::Vector3d colour = 0.5 + 0.4 * Eigen::Array3d(3 * mean.x(), 5 * mean.y() + 1, 7 * mean.z() + 2).sin();
    add_looks(g, draws, 2.5, colour, 0.03);
  }
  return g;
}

// Eight that look at `target`; `eye_at` gives where from, for an angle.
template <class Eye>
std::vector<Camera> around(const Eye& eye_at, const Eigen::Vector3d& target, const Eigen::Vector3d& up, int width,
                           int height, double fov_degrees) {
  std::vector<Camera> cameras(8);
  for (std::size_t i = 0; i < 8; ++i) {
    Camera& c = cameras[i];
    const Eigen::Vector3d eye = eye_at(static_cast<double>(i) * kPi / 4);
    const Eigen::Vector3d forward = (target - eye).normalized(), right = forward.cross(up).normalized();
    Eigen::Matrix3d rotation;
    rotation << right.transpose(), forward.cross(right).transpose(), forward.transpose();
    c.w2c.topLeftCorner<3, 3>() = rotation;
    c.w2c.topRightCorner<3, 1>() = -rotation * eye;
    c.width = width, c.height = height;
    c.fx = c.fy = 0.5 * width / std::tan(fov_degrees * kPi / 360);
    c.cx = 0.5 * width, c.cy = 0.5 * height;
  }
  return cameras;
}

std::vector<Camera> about_object(int size) {
  const auto eye = [](double t) {
    return Eigen::Vector3d(1.6 * std::cos(0.3) * std::sin(t), -1.6 * std::sin(0.3), -1.6 * std::cos(0.3) * std::cos(t));
  };
  return around(eye, Eigen::Vector3d::Zero(), {0, -1, 0}, size, size, 50);
}

std::vector<Camera> over_ground() {
  const auto eye = [](double t) { return Eigen::Vector3d(5 * std::cos(t), 5 * std::sin(t), 2.5); };
  return around(eye, {0, 0, 0.2}, {0, 0, 1}, 1280, 720, 60);
}

}  // namespace

std::vector<std::string> scene_names() { return {"small-5k", "object-190k", "slab-1m"}; }

std::vector<std::string> scene_names(const std::string& folder) {
  std::vector<std::string> out;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::filesystem::path& file = entry.path();
    if (file.extension() == ".ply" &&
        std::filesystem::exists(file.parent_path() / (file.stem().string() + ".cameras.json")))
      out.push_back(file.stem().string());
  }
  if (error) fail(Status::file, "{}: cannot be listed: {}", folder, error.message());
  if (out.empty()) fail(Status::input, "{}: no NAME.ply with a NAME.cameras.json beside it", folder);
  std::sort(out.begin(), out.end());
  return out;
}

BenchScene make_scene(const std::string& name) {
  BenchScene out;
  if (name == "small-5k") {
    out.scene.gaussians = shell(14, 250, 20);
    out.cameras = about_object(128);
  } else if (name == "object-190k") {
    out.scene.gaussians = shell(48, 48 * 48 * 48 / 10, 17);
    out.cameras = about_object(512);
  } else if (name == "surfels-190k") {
    out = make_scene("object-190k");
    Gaussians& g = out.scene.gaussians;
    for (std::size_t k = 0; k < g.count; ++k) std::copy_n(&g.scales[3 * k], 2, &g.scales[2 * k]);
    g.scales.resize(2 * g.count);
    g.kind = GaussianKind::surfel;
  } else if (name == "slab-1m") {
    out.scene.gaussians = slab(1000000);
    out.cameras = over_ground();
  } else {
    fail(Status::usage, "no scene \"{}\" to bench; there is: {}", name, fmt::join(scene_names(), ", "));
  }
  return out;
}

BenchScene read_scene(const std::string& folder, const std::string& name) {
  const std::filesystem::path base(folder);
  BenchScene out;
  out.scene = read_ply((base / (name + ".ply")).string());
  const std::filesystem::path cameras = base / (name + ".cameras.json");
  ReadOptions options;
  options.need_pictures = false;
  for (const ListedView& view : read_views(cameras, options).views) {
    if (!is_resolved(view))
      fail(Status::input, "{}: view \"{}\" lacks its size or intrinsics; give w, h, fx, fy, cx, cy", cameras.string(),
           view.name);
    out.cameras.push_back(view.camera);
  }
  if (out.cameras.empty()) fail(Status::input, "{}: no cameras", cameras.string());
  return out;
}

}  // namespace vsplat::bench
