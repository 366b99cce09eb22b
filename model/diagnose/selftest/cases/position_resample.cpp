#include "model/diagnose/selftest/reference/position_resample.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/position_resample.h"

namespace vsplat::selftest {
namespace {

void position_resample_all(Checks& c) {
  for (const auto& [g, t, channels] :
       c.some({std::array<long, 3>{1, 1, 1}, {3, 7, 5}, {7, 3, 16}, {5, 16, 33}, {14, 9, 7}},
              {{1, 3, 5}, {3, 2, 5}, {4, 6, 5}, {14, 32, 5}, {14, 5, 5}, {7, 1, 5}, {16, 17, 5}})) {
    const std::size_t n = size_of(channels);
    const auto stored = random_floats((1 + size_of(g, g)) * n, 1), token = random_floats(n, 2),
               dout = random_floats((1 + size_of(t, t)) * n, 3);
    const Tensor out = c.gap({1 + t * t, channels});
    position_resample_forward(c.ctx, {c.up({1 + g * g, channels}, stored), c.up({channels}, token), static_cast<int>(g),
                                      static_cast<int>(t), out});
    std::vector<double> want;
    for (std::size_t i = 0; i < n; ++i) want.push_back(static_cast<double>(stored[i]) + token[i]);
    const std::vector<float> grid(stored.begin() + channels, stored.end());
    for (const double v : ref::resample(grid, size_of(g), size_of(t), n)) want.push_back(v);
    c.close("forward", out, want, c.within(1e-5, 2e-6));
    const auto before = random_floats(stored.size(), 4), token_before = random_floats(n, 5);
    const Tensor dstored = c.up({1 + g * g, channels}, before), dtoken = c.up({channels}, token_before);
    position_resample_backward(
        c.ctx, {c.up({1 + t * t, channels}, dout), static_cast<int>(g), static_cast<int>(t), dstored, dtoken});
    std::vector<double> by(dout.begin(), dout.begin() + channels);
    c.close("backward, dclass_token", dtoken, plus(by, token_before), c.within(1e-6, 2e-7));
    const std::vector<double> by_grid(dout.begin() + channels, dout.end());
    for (const double v : ref::resample_backward(by_grid, size_of(g), size_of(t), n)) by.push_back(v);
    c.close("backward, dstored", dstored, plus(by, before), c.within(1e-5, 2e-6));
  }
}

}  // namespace

VSPLAT_CASES(position_resample, {"position_resample", position_resample_all})

}  // namespace vsplat::selftest
