#include "model/ops/render/area_mean.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void area_mean_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {16, 15}, {17, 33}}))
    for (const long k : {2L, 3L}) {
      const auto x = random_floats(size_of(k * h, 3 * k * w), static_cast<std::uint32_t>(h + w + k));
      std::vector<double> want(size_of(h, 3 * w));
      const auto wide = static_cast<std::size_t>(w), by = static_cast<std::size_t>(k);
      for (std::size_t i = 0; i < x.size(); ++i)
        want[(i / (3 * by * wide) / by * wide + i / 3 % (by * wide) / by) * 3 + i % 3] +=
            static_cast<double>(x[i]) / static_cast<double>(k * k);
      const Tensor out = c.gap({h, w, 3});
      area_mean(c.ctx, {c.up({k * h, k * w, 3}, x), out, static_cast<int>(k)});
      c.close("means", out, want, 1e-6);
    }
}

}  // namespace

VSPLAT_CASES(area_mean, {"area_mean", area_mean_all})

}  // namespace vsplat::selftest
