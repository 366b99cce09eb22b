#include "model/diagnose/selftest/reference/depth_loss.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/ops/fit/depth_loss.h"

namespace vsplat::selftest {
namespace {

void depth_loss_all(Checks& c) {
  for (const auto& [h, w] :
       c.some({std::array<long, 2>{1, 3}, {3, 1}, {7, 9}, {8, 8}, {5, 13}, {31, 37}}, {{1, 1}, {0, 5}}))
    for (const DepthKind kind : c.some({DepthKind::metric, DepthKind::inverse}, {DepthKind::relative})) {
      const std::size_t n = size_of(h, w);
      if (kind != DepthKind::metric && n < 2) continue;
      std::vector<float> depth, alpha, given;
      const auto random = random_floats(4 * n, static_cast<std::uint32_t>(61 * h + w), 0, 1);
      ref::DepthLossInput in;
      in.metric = kind == DepthKind::metric, in.inverse = kind == DepthKind::inverse;
      double known = 0;
      for (std::size_t i = 0; i < n; ++i) {
        const float* r = &random[4 * i];
        const float z = 1 + 3 * r[0], a = i % 5 == 4 ? 0.0f : 0.05f + 0.95f * r[1];
        depth.push_back(a * z), alpha.push_back(a);
        const float truth = in.metric ? z : in.inverse ? 1.2f / z - 0.2f : 0.2f * z + 0.1f;
        given.push_back(i % 7 == 3 ? 0.0f : truth * (r[2] < 0.5f ? 0.8f : 1.2f));
        known += given.back() > 0 ? 1 : 0;
        in.depth.push_back(depth.back()), in.alpha.push_back(a), in.given.push_back(given.back());
      }
      const std::vector<double> want = ref::wanted_depths(in);
      std::vector<double> ddepth, dalpha;
      for (std::size_t i = 0; i < n; ++i) {
        const double slope = 0.3 / known, step = 1e-6;
        const auto loss = [&](double dz, double da) {
          return ref::depth_loss(in, want, i, in.depth[i] + dz, in.alpha[i] + da, slope);
        };
        const bool counts = in.counts(i);
        ddepth.push_back(counts ? (loss(step, 0) - loss(-step, 0)) / (2 * step) : 0);
        dalpha.push_back(0.5 + (counts ? (loss(0, step) - loss(0, -step)) / (2 * step) : 0));
      }
      DepthLoss a;
      a.drawn.depth = c.up({h, w}, depth), a.drawn.alpha = c.up({h, w}, alpha), a.given = c.up({h, w}, given);
      a.kind = kind, a.weight = 0.3f, a.known = known;
      a.ddepth = c.gap({h, w}), a.dalpha = c.up({h, w}, std::vector<float>(n, 0.5f));
      depth_loss(c.ctx, a);
      c.close("gradient of depth", a.ddepth, ddepth, 1e-4);
      c.close("gradient of alpha", a.dalpha, dalpha, 1e-5);
    }
}

}  // namespace

VSPLAT_CASES(depth_loss, {"depth_loss", depth_loss_all})

}  // namespace vsplat::selftest
