// Pictures of a mesh file, and a measure of the difference between two sets of them.
#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/base/image.h"
#include "model/data/mesh_file.h"
#include "model/data/ray_tracer.h"
#include "model/views/orbit.h"

namespace vsplat::test {

// Renders the mesh from three sides.
inline std::vector<Image> drawn(const std::string& path) {
  Mesh mesh = load_mesh(path);
  fit_into_cube(mesh);
  const RayTracer tracer(mesh);
  std::vector<Image> out;
  for (const Eigen::Vector3d& eye :
       {Eigen::Vector3d(1, 0.7, 1.6), Eigen::Vector3d(-1.5, -1, 0.9), Eigen::Vector3d(0.4, 1.1, -1.7)}) {
    Camera c;
    c.width = c.height = 96;
    c.fx = c.fy = 120;
    c.cx = c.cy = 48;
    c.w2c = look_at(eye, Eigen::Vector3d::Zero(), Eigen::Vector3d(0, 1, 0));
    out.push_back(tracer.picture(c, 2));
  }
  return out;
}

// PSNR of colours times alpha, and alpha; 200 if they are equal.
inline double psnr(const std::vector<Image>& a, const std::vector<Image>& b) {
  double sum = 0;
  std::size_t count = 0;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    for (std::size_t p = 0; p < a[i].data.size(); p += 4)
      for (std::size_t c = 0; c < 4; ++c, ++count) {
        const auto value = [&](const Image& of) { return of.data[p + c] * (c < 3 ? of.data[p + 3] : 1); };
        sum += std::pow(static_cast<double>(value(a[i]) - value(b[i])), 2);
      }
  return sum > 0 ? std::min(200.0, -10 * std::log10(sum / static_cast<double>(count))) : 200;
}

}  // namespace vsplat::test
