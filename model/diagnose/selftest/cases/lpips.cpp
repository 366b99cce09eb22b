#include "model/diagnose/selftest/reference/lpips.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/lpips.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

void lpips_all(Checks& c) {
  struct Try {
    int height, width, channels, outs;
    Window2d window;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1, {1, 1, 0}},
                              {3, 7, 3, 5, {3, 1, 1}},
                              {11, 13, 3, 7, {11, 4, 2}},
                              {17, 31, 3, 33, {5, 1, 2}}},
                             {{7, 3, 1, 17, {3, 1, 0}},
                              {16, 15, 5, 3, {5, 1, 2}},
                              {17, 31, 3, 33, {11, 4, 2}},
                              {1, 5, 4, 2, {3, 2, 1}},
                              {2, 2, 2, 3, {3, 1, 1}}})) {
    const auto taps = size_of(t.window.side, t.window.side), cin = size_of(t.channels), cout = size_of(t.outs);
    const auto in = random_floats(size_of(t.height, t.width) * cin, 1), w = random_floats(cout * cin * taps, 2);
    std::vector<float> last(w.size());
    for (std::size_t i = 0; i < w.size(); ++i) last[(i / (cin * taps) * taps + i % taps) * cin + i / taps % cin] = w[i];
    const long k = static_cast<long>(taps * cin), places = t.window.places(t.height) * t.window.places(t.width);
    const PackedMatrix packed = pack_matrix(c.ctx, last.data(), k, t.outs, 1, k, "w");
    Gemm g;
    g.a.x0 = c.up({t.height, t.width, t.channels}, in), g.a.map = picture_map(c.ctx, t.height, t.width, t.window);
    g.b = &packed, g.out = c.gap({places, t.outs});
    c.that("map's shape", g.a.map.shape() == Shape{places, static_cast<long>(taps)});
    gemm(c.ctx, g);
    c.close("convolution by a map", g.out,
            ref::conv2d(in, t.height, t.width, t.channels, w, t.outs, static_cast<int>(t.window.side),
                        static_cast<int>(t.window.stride), static_cast<int>(t.window.pad)),
            1e-5);
  }
  for (const auto& [h, w, channels, side] :
       c.some({std::array<int, 4>{3, 3, 7, 3}, {7, 8, 3, 3}, {13, 9, 64, 3}, {8, 17, 65, 3}},
              {{2, 2, 1, 2}, {7, 8, 3, 2}, {8, 17, 5, 3}, {5, 5, 101, 2}})) {
    auto in = random_floats(size_of(h, w) * size_of(channels), 3, -2, -1);
    if (c.all) in[in.size() / 2] = 5;
    const Tensor picture = c.up({h, w, channels}, in);
    const Window2d windows{side, 2, 0};
    const Tensor pooled = max_pool(c.ctx, picture, windows);
    c.that("pooled shape", pooled.shape() == Shape{windows.places(h), windows.places(w), channels});
    c.close("largest of windows", pooled, ref::max_pool(in, h, w, channels, side, 2), 0);
  }
  for (const long n : c.some({1L, 63L, 64L, 65L, 1009L}, {3L})) {
    const auto x = random_floats(size_of(n), 4);
    std::vector<float> want = x;
    for (float& v : want) v = v > 0 ? v : 0;
    const Tensor t = c.up({n}, x);
    relu(c.ctx, t);
    c.equal("ReLU", t, want);
  }
  for (const auto& [places, channels] :
       c.some({std::array<long, 2>{3, 7}, {7, 3}, {65, 64}, {64, 65}, {13, 512}}, {{1, 1}, {101, 512}})) {
    const auto a = random_floats(size_of(places, channels), 5, 0, 1),
               weight = random_floats(size_of(channels), 7, 0.1f, 1);
    auto b = random_floats(a.size(), 6, -0.5f, 1);
    if (channels == 1) b[0] = -0.3f;  // unit vectors of one number differ by their sign alone
    const Tensor out = c.gap({places});
    feature_distance(c.ctx, {c.up({places, channels}, a), c.up({places, channels}, b), c.up({channels}, weight), out});
    c.close("distance", out, ref::feature_distance(a, b, weight), 1e-5);
  }
}

}  // namespace

VSPLAT_CASES(lpips, {"lpips", lpips_all})

}  // namespace vsplat::selftest
