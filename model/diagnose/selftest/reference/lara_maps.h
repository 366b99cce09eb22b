// The maps that LaRa derives from a picture's maps, in double: the reference for cl/networks/lara_maps.cl.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <vector>

#include "model/base/camera.h"

namespace vsplat::ref {

struct PictureMaps {
  std::vector<double> colour, alpha, depth, normal;  // [H,W,3], [H,W], [H,W], [H,W,3]
};

struct LaraMaps {
  std::vector<double> image, depth, normal, depth_normal;  // [H,W,3], [H,W], [H,W,3], [H,W,3]
};

// `held`: the alphas that depth_normal is multiplied by.
inline LaraMaps lara_maps(const PictureMaps& m, const Camera& cam, const std::vector<double>& held) {
  LaraMaps out;
  const Eigen::Matrix3d to_world = cam.w2c.topLeftCorner<3, 3>().transpose();
  std::vector<Eigen::Vector3d> points;
  const auto add = [](std::vector<double>& to, const Eigen::Vector3d& v) {
    to.insert(to.end(), v.data(), v.data() + 3);
  };
  for (const double c : m.colour) out.image.push_back(std::clamp(c, 0.0, 1.0));
  for (int y = 0; y < cam.height; ++y) {
    for (int x = 0; x < cam.width; ++x) {
      const std::size_t at = points.size();
      out.depth.push_back(m.alpha[at] > 0 ? m.depth[at] / m.alpha[at] : 0);
      const Eigen::Vector3d ray((x + 0.5 - cam.cx) / cam.fx, (y + 0.5 - cam.cy) / cam.fy, 1);
      points.push_back(cam.centre() + out.depth.back() * (to_world * ray));
      add(out.normal, to_world * Eigen::Vector3d(m.normal[3 * at], m.normal[3 * at + 1], m.normal[3 * at + 2]));
    }
  }
  const auto w = static_cast<std::size_t>(cam.width);
  for (std::size_t at = 0; at < points.size(); ++at) {
    const std::size_t x = at % w, y = at / w;
    Eigen::Vector3d n = Eigen::Vector3d::Zero();
    if (x > 0 && y > 0 && x + 1 < w && y + 1 < static_cast<std::size_t>(cam.height)) {
      n = (points[at + w] - points[at - w]).cross(points[at + 1] - points[at - 1]);
      n *= held[at] / std::max(n.norm(), 1e-12);
    }
    add(out.depth_normal, n);
  }
  return out;
}

}  // namespace vsplat::ref
