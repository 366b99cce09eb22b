#include "model/diagnose/selftest/reference/plucker.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/ops/networks/plucker.h"

namespace vsplat::selftest {
namespace {

void plucker_all(Checks& c) {
  for (const auto& [views, size, patch] :
       c.some({std::array<int, 3>{1, 3, 3}, {3, 21, 7}, {2, 48, 16}}, {{1, 5, 5}, {3, 56, 8}, {5, 144, 16}})) {
    const auto cameras = orbit(views, size);
    const long t = size / patch;
    const Tensor out = c.gap({views, t, t, 32});
    plucker_forward(c.ctx, {upload_cameras(c.ctx, cameras), patch, out});
    std::vector<double> want;
    for (const Camera& camera : cameras)
      for (long i = 0; i < t * t; ++i) {
        Eigen::Vector3d direction, moment;
        ref::plucker(camera, (static_cast<double>(i % t) + 0.5) * patch, (static_cast<double>(i / t) + 0.5) * patch,
                     direction, moment);
        for (const Eigen::Vector3d& of : {direction, moment})
          for (const double v : ref::real_sh3(of)) want.push_back(v);
      }
    c.close("forward", out, want, 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(plucker, {"plucker", plucker_all})

}  // namespace vsplat::selftest
