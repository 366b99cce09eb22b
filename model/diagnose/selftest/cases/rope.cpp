#include "model/diagnose/selftest/reference/rope.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/rope.h"

namespace vsplat::selftest {
namespace {

void rope_all(Checks& c) {
  for (const auto& [h, w, prefix, heads, d] :
       c.some({std::array<long, 5>{1, 1, 0, 1, 4}, {2, 3, 1, 2, 8}, {3, 5, 5, 3, 12}, {7, 9, 1, 2, 64}},
              {{3, 5, 3, 3, 8}, {7, 1, 1, 2, 12}, {1, 13, 5, 1, 64}})) {
    const long v = 2, t = h * w + prefix;
    const auto qkv = random_floats(static_cast<std::size_t>(v * t * 3 * heads * d), 1);
    const auto at = [](long n) { return static_cast<std::size_t>(n); };
    const auto angles = ref::rope_angles(at(h), at(w), at(d), 100);
    const Tensor turns = c.up({h * w, d / 2, 2}, rope_turns(h, w, d, 100, false));
    const Tensor there = c.up({v, t, 3, heads, d}, qkv), back = c.up({v, t, 3, heads, d}, qkv);
    rope_forward(c.ctx, {there, turns});
    c.close("forward", there, ref::rope(qkv, at(v), at(t), at(heads), at(d), angles, 1), 1e-6);
    rope_backward(c.ctx, {back, turns});
    c.close("backward", back, ref::rope(qkv, at(v), at(t), at(heads), at(d), angles, -1), 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(rope, {"rope", rope_all})

}  // namespace vsplat::selftest
