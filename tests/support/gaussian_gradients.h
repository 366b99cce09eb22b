// Gradients by Gaussians and by a camera's pose, compared with each other and with differences.
#pragma once
#include <array>
#include <functional>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "model/diagnose/selftest/inputs/se3.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/render/render.h"
#include "tests/support/compare.h"

namespace vsplat::test {

struct GaussianField {
  const char* name;
  std::vector<float> Gaussians::*values;
};
inline constexpr GaussianField kGaussianFields[] = {{"means", &Gaussians::means},
                                                    {"scales", &Gaussians::scales},
                                                    {"quats", &Gaussians::quats},
                                                    {"opacities", &Gaussians::opacities},
                                                    {"sh", &Gaussians::sh}};

inline void expect_close(const Gaussians& got, const Gaussians& want, double tolerance) {
  for (const auto& [name, values] : kGaussianFields) EXPECT_TRUE(close(got.*values, want.*values, tolerance)) << name;
}

inline void expect_same(const Gaussians& got, const Gaussians& want) {
  for (const auto& [name, values] : kGaussianFields) EXPECT_EQ(got.*values, want.*values) << name;
}

// The scene, uploaded chunk by chunk. It must outlive them.
inline GaussianChunks in_chunks(const Gaussians& g) {
  const auto chunk_at = [&g](Context& on, long i) {
    const long first = i * kChunkUnit;
    return upload(on, g, first, std::min(static_cast<long>(g.count) - first, kChunkUnit));
  };
  return {static_cast<long>(g.count), g.sh_degree, kChunkUnit, chunk_at, g.kind};
}

// Compares gradients with fourth-order differences of `loss` at a scene and a camera: of steps `step` and twice that,
// by the pose of half as much.
inline void expect_differences(const Gaussians& got, const std::array<double, 6>& pose, const Gaussians& at,
                               const Camera& camera, float step,
                               const std::function<double(const Gaussians&, const Camera&)>& loss) {
  constexpr double kTolerance = 2e-5;
  Gaussians moved = at;
  const auto here = [&] { return loss(moved, camera); };
  for (const auto& [name, values] : kGaussianFields) {
    std::vector<double> want;
    for (float& value : moved.*values) want.push_back(ref::derivative_by(value, 2 * step, here));
    const std::size_t channels = values == &Gaussians::sh ? 3 * at.sh_count() : 1;
    EXPECT_TRUE(close_by_channel(got.*values, want, channels, kTolerance)) << name;
  }
  std::vector<double> want;
  for (long i = 0; i < 6; ++i)
    want.push_back(ref::derivative_at_0(step, [&](double by) {
      Eigen::Matrix<double, 6, 1> motion = Eigen::Matrix<double, 6, 1>::Zero();
      motion[i] = by;
      Camera turned = camera;
      turned.w2c = selftest::exp_se3(motion) * camera.w2c;
      return loss(at, turned);
    }));
  EXPECT_TRUE(close(std::vector<double>(pose.begin(), pose.end()), want, kTolerance)) << "pose";
}

}  // namespace vsplat::test
