// Synthetic rigs of cameras and a temporary folder, for the tests of posed views.
#pragma once
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/views/orbit.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat::test {

class ViewFolder : public test::TemporaryFolder {
 public:
  std::filesystem::path path() const { return string(); }
  std::filesystem::path operator/(const std::string& name) const { return path() / name; }
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::filesystem::create_directories((path() / name).parent_path());
    std::ofstream(path() / name, std::ios::binary) << bytes;
    return path() / name;
  }
  std::filesystem::path touch(const std::string& name) const { return write(name, "x"); }
};

// Cameras around `centre` that look past it by `off_degrees`, each in another direction.
inline std::vector<Camera> ring(int count, const Eigen::Vector3d& centre = Eigen::Vector3d::Zero(), double radius = 2,
                                double elevation = 0.3, double off_degrees = 0) {
  std::vector<Camera> out;
  for (int i = 0; i < count; ++i) {
    const double a = 2 * M_PI * i / count, off = radius * std::tan(off_degrees * M_PI / 180);
    const Eigen::Vector3d level(std::sin(a), 0, -std::cos(a)), side(std::cos(a), 0, std::sin(a)), up(0, -1, 0);
    const Eigen::Vector3d eye = centre + radius * (std::cos(elevation) * level + std::sin(elevation) * up);
    Camera c;
    c.file = fmt::format("{}.png", i);
    c.width = 640, c.height = 480;
    c.fx = 800, c.fy = 790, c.cx = 322, c.cy = 237;
    c.w2c = look_at(eye, centre + off * (std::cos(2.4 * i) * side + std::sin(2.4 * i) * up), up);
    out.push_back(c);
  }
  return out;
}

}  // namespace vsplat::test
