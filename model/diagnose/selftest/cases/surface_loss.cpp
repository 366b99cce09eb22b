#include "model/diagnose/selftest/reference/surface_loss.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/surface_loss.h"

namespace vsplat::selftest {
namespace {

void surface_loss_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {7, 3}, {31, 11}, {1, 2047}, {32, 64}, {97, 61}},
                                   {{1, 3}, {7, 1}, {1, 2049}})) {
    const std::size_t n = size_of(h, w);
    const auto normal = random_floats(3 * n, 1), depth_normal = random_floats(3 * n, 2),
               alpha = random_floats(n, 3, 0, 1), distortion = random_floats(n, 4, 0, 0.1f);
    const Shape vectors{h, w, 3}, map{h, w};
    SurfaceLoss a;
    a.normal = c.up(vectors, normal), a.depth_normal = c.up(vectors, depth_normal);
    a.alpha = c.up(map, alpha), a.distortion = c.up(map, distortion), a.weights = {7, 0.3f};
    a.value = c.up({3}, std::vector<float>{2, 3, 4}), a.gradient_scale = 0.25f;
    a.dnormal = c.gap(vectors), a.ddepth_normal = c.gap(vectors), a.ddistortion = c.gap(map);
    surface_loss(c.ctx, a);
    const double value = ref::surface_loss(as_doubles(normal), as_doubles(depth_normal), as_doubles(alpha),
                                           as_doubles(distortion), 7, static_cast<double>(0.3f));
    c.close("loss", a.value, std::vector<double>{2 + value, 3, 4}, 1e-6);
    // Linear in each map: d/dn = -w alpha depth_normal / N, and so on.
    const double each = 0.25 / static_cast<double>(n), by = -static_cast<double>(0.3f) * each;
    std::vector<double> dnormal, ddepth_normal;
    for (std::size_t i = 0; i < 3 * n; ++i) {
      dnormal.push_back(by * alpha[i / 3] * depth_normal[i]);
      ddepth_normal.push_back(by * alpha[i / 3] * normal[i]);
    }
    c.close("gradient, normal", a.dnormal, dnormal, 1e-5);
    c.close("gradient, normal of depths", a.ddepth_normal, ddepth_normal, 1e-5);
    c.close("gradient, distortion", a.ddistortion, std::vector<double>(n, 7 * each), 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(surface_loss, {"surface_loss", surface_loss_all})

}  // namespace vsplat::selftest
