#include "model/diagnose/selftest/reference/view_maps.h"

#include <algorithm>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/reference/differences.h"
#include "model/ops/networks/view_maps.h"

namespace vsplat::selftest {
namespace {

// `drawn` views of three, from `first` on.
void view_maps_of(Checks& c, long edge, long first, long drawn) {
  constexpr long views = 3;
  for (const bool by_alpha : {false, true}) {
    const std::size_t pixels = size_of(drawn * edge, edge), before = size_of(first * edge, edge);
    const auto images = random_floats(size_of(3 * views * edge, edge), 1, 0, 1),
               colour = random_floats(3 * pixels, 2, -0.5f, 1.5f),
               dmaps = random_floats(size_of(8 * views * edge, edge), 5);
    auto alpha = random_floats(pixels, 3, -0.5f, 1), depth = random_floats(pixels, 4, 0.5f, 3);
    for (std::size_t i = 0; i < pixels; ++i)
      if (alpha[i] <= 0) alpha[i] = depth[i] = 0;  // nothing in it
    std::vector<double> want(size_of(8 * views * edge, edge), 9.0), dcolour, dalpha, ddepth;
    for (std::size_t i = 0; i < pixels; ++i) {
      const std::size_t at = before + i;
      const double drawing[3] = {colour[3 * i], colour[3 * i + 1], colour[3 * i + 2]};
      const auto rest = ref::view_map(drawing, alpha[i], depth[i], by_alpha);
      for (std::size_t k = 0; k < 3; ++k) want[8 * at + k] = images[3 * at + k];
      std::copy(rest.begin(), rest.end(), want.begin() + static_cast<long>(8 * at + 3));
      const float* by = &dmaps[8 * at + 3];
      const std::vector<float> slopes(by, by + 5);
      double moved[5] = {drawing[0], drawing[1], drawing[2], alpha[i], depth[i]};
      for (int k = 0; k < 5; ++k) {
        const auto loss = [&] { return ref::weighed(ref::view_map(moved, moved[3], moved[4], by_alpha), slopes); };
        // Where nothing is drawn alpha has no two sides: its gradient is that of the map's alpha alone.
        const double slope =
            by_alpha && k >= 3 && moved[k] == 0 ? (k == 3 ? by[3] : 0) : ref::derivative_by(moved[k], 1e-6, loss);
        (k < 3 ? dcolour : k == 3 ? dalpha : ddepth).push_back(slope);
      }
    }
    const ViewDrawings there{c.up({drawn, edge, edge, 3}, colour), c.up({drawn, edge, edge}, alpha),
                             c.up({drawn, edge, edge}, depth)};
    const Tensor maps = c.up({views, edge, edge, 8}, std::vector<float>(want.size(), 9.0f));
    view_maps_forward(c.ctx, {c.up({views, edge, edge, 3}, images), there, first, by_alpha, maps});
    c.close("forward", maps, want, 1e-6);
    const ViewDrawings by{c.gap(there.colour.shape()), c.gap(there.alpha.shape()), c.gap(there.depth.shape())};
    view_maps_backward(c.ctx, {there, first, by_alpha, c.up({views, edge, edge, 8}, dmaps), by});
    c.close("backward, colour", by.colour, dcolour, 1e-5);
    c.close("backward, alpha", by.alpha, dalpha, 1e-5);
    c.close("backward, depth", by.depth, ddepth, 1e-5);
  }
}

void view_maps_all(Checks& c) {
  view_maps_of(c, 7, 1, 2);
  if (!c.all) return;
  view_maps_of(c, 1, 0, 3);
  view_maps_of(c, 7, 2, 1);
  view_maps_of(c, 11, 1, 2);
}

}  // namespace

VSPLAT_CASES(view_maps, {"view_maps", view_maps_all})

}  // namespace vsplat::selftest
