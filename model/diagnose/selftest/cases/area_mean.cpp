#include "model/ops/render/area_mean.h"

#include <algorithm>
#include <array>

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

// `channels` 0: no dimension of channels.
void area_mean_of(Checks& c, long h, long w, long channels, long k) {
  const std::size_t each = size_of(std::max(channels, 1L)), wide = size_of(w), by = size_of(k);
  const auto x = random_floats(size_of(k * h, k * w) * each, static_cast<std::uint32_t>(h + w + k));
  std::vector<double> want(size_of(h, w) * each);
  for (std::size_t i = 0; i < x.size(); ++i)
    want[(i / (each * by * wide) / by * wide + i / each % (by * wide) / by) * each + i % each] +=
        static_cast<double>(x[i]) / static_cast<double>(k * k);
  Shape in{k * h, k * w}, shape{h, w};
  if (channels > 0) in.push_back(channels), shape.push_back(channels);
  const Tensor out = c.gap(shape);
  area_mean(c.ctx, {c.up(in, x), out, static_cast<int>(k)});
  c.close("means", out, want, k == 1 ? 0 : 1e-6);
}

void area_mean_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {16, 15}, {17, 33}}))
    for (const long k : {2L, 3L}) area_mean_of(c, h, w, 3, k);
  if (!c.all) return;
  for (const auto& [h, w] : {std::pair{0L, 5L}, {1L, 1L}, {3L, 7L}, {16L, 15L}, {17L, 31L}})
    for (const long channels : {0L, 1L, 3L})
      for (const long k : {1L, 2L, 3L, 8L}) area_mean_of(c, h, w, channels, k);
}

}  // namespace

VSPLAT_CASES(area_mean, {"area_mean", area_mean_all})

}  // namespace vsplat::selftest
