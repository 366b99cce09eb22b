// Random scenes and cameras for tests of splatting, each awkward in its own way.
#pragma once
#include <Eigen/Geometry>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"

namespace vsplat::selftest {

// At `eye`, looking at `target`; `up` points up in the picture.
inline Camera look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, const Eigen::Vector3d& up, int width,
                      int height, double focal) {
  Camera cam;
  cam.width = width;
  cam.height = height;
  cam.fx = cam.fy = focal;
  cam.cx = width / 2.0;
  cam.cy = height / 2.0;
  const Eigen::Vector3d f = (target - eye).normalized(), r = f.cross(up).normalized();
  Eigen::Matrix3d rotation;
  rotation.row(0) = r;
  rotation.row(1) = f.cross(r);
  rotation.row(2) = f;
  cam.w2c.setIdentity();
  cam.w2c.topLeftCorner<3, 3>() = rotation;
  cam.w2c.topRightCorner<3, 1>() = -rotation * eye;
  return cam;
}

struct SceneCase {
  std::string name;
  std::size_t count;
  int degree, width, height;
  std::string kind;  // "", off-centre, near, needles, discs, opacity, large, cluster
};

inline std::vector<SceneCase> scene_cases() {
  return {{"one", 1, 0, 64, 64, ""},
          {"seventeen", 17, 1, 50, 37, ""},
          {"plain", 500, 1, 96, 80, ""},
          {"degree2", 300, 2, 64, 48, ""},
          {"degree3", 300, 3, 64, 48, ""},
          {"many", 5000, 1, 128, 96, ""},
          {"off_centre", 300, 1, 61, 97, "off-centre"},
          {"near", 400, 1, 64, 64, "near"},
          {"needles", 200, 1, 96, 96, "needles"},
          {"discs", 200, 1, 96, 96, "discs"},
          {"extremes", 200, 1, 64, 64, "opacity"},
          {"one_pixel", 50, 1, 1, 1, ""},
          {"empty", 0, 1, 33, 17, ""},
          {"large", 60, 1, 200, 40, "large"},
          {"dense", 1000, 0, 48, 33, "cluster"}};
}

inline Gaussians make_scene(const SceneCase& c, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  Gaussians g;
  g.count = c.count;
  g.sh_degree = c.degree;
  for (std::size_t k = 0; k < c.count; ++k) {
    const double reach = c.kind == "near" ? 2 : c.kind == "cluster" ? 0.1 : 0.5;
    double scale[3];
    for (int i = 0; i < 3; ++i) {
      g.means.push_back(static_cast<float>(reach * (2 * uniform(engine) - 1)));
      scale[i] = std::exp(-3.5 + 0.6 * normal(engine)) * (c.kind == "large" ? 30 : 1);
    }
    if (c.kind == "needles") scale[0] = 0.2, scale[1] = scale[2] = 2e-4;
    if (c.kind == "discs") scale[0] = scale[1] = 0.2, scale[2] = 2e-4;
    for (const double s : scale) g.scales.push_back(static_cast<float>(s));
    Eigen::Vector4d q(normal(engine), normal(engine), normal(engine), normal(engine));
    q.normalize();
    for (int i = 0; i < 4; ++i) g.quats.push_back(static_cast<float>(q[i]));
    const double extremes[] = {0, 1e-6, 1.0 / 256, 0.5, 0.989, 0.991, 1 - 1e-6, 1};
    g.opacities.push_back(
        static_cast<float>(c.kind == "opacity" ? extremes[engine() % 8] : 0.05 + 0.9 * uniform(engine)));
    for (std::size_t i = 0; i < 3 * g.sh_count(); ++i) g.sh.push_back(static_cast<float>(0.5 * normal(engine)));
  }
  return g;
}

// The same as surfels: without their third axis.
inline Gaussians make_surfels(const SceneCase& c, std::uint32_t seed) {
  Gaussians g = make_scene(c, seed);
  g.kind = GaussianKind::surfel;
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t i = 0; i < 2; ++i) g.scales[2 * k + i] = g.scales[3 * k + i];
  g.scales.resize(2 * g.count);
  return g;
}

inline Camera make_camera(const SceneCase& c, std::uint32_t seed) {
  std::mt19937 engine(seed + 1000);
  std::normal_distribution<double> normal;
  Eigen::Vector3d eye(normal(engine), normal(engine), normal(engine));
  Camera cam = look_at(1.5 * eye.normalized(), Eigen::Vector3d::Zero(), {0.1, 1, 0.2}, c.width, c.height,
                       0.9 * std::max(c.width, c.height));
  if (c.kind == "off-centre") {
    cam.fy *= 1.3;
    cam.cx = 0.1 * c.width;
    cam.cy = 1.2 * c.height;
  }
  return cam;
}

// Makes each Gaussian's quaternion another multiple of its length: by * (first + its index).
inline void lengthen_quats(Gaussians& g, float by, std::size_t first = 1) {
  for (std::size_t i = 0; i < g.quats.size(); ++i) {
    const std::size_t gaussian = i / 4;
    g.quats[i] *= by * static_cast<float>(first + gaussian);
  }
}

}  // namespace vsplat::selftest
