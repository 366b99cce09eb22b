#include "model/diagnose/selftest/reference/picture_target.h"

#include <array>
#include <cmath>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/random_values.h"
#include "model/ops/fit/picture_target.h"

namespace vsplat::selftest {
namespace {

void picture_target_all(Checks& c) {
  for (const auto& [h, w] :
       c.some({std::array<long, 2>{1, 1}, {3, 1}, {7, 9}, {8, 8}, {5, 13}, {31, 37}}, {{0, 0}, {0, 5}}))
    for (const bool masked : c.some({true}, {false})) {
      const std::size_t n = size_of(h, w);
      std::vector<std::uint8_t> given, known;
      std::vector<float> colour, alpha;
      const auto random = random_floats(8 * n, static_cast<std::uint32_t>(97 * h + w), 0, 1);
      for (std::size_t i = 0; i < n; ++i) {
        const float* r = &random[8 * i];
        const int a = i % 3 == 0 ? 255 : i % 3 == 1 ? static_cast<int>(255 * r[0]) : 0;
        for (int k = 1; k < 4; ++k) given.push_back(static_cast<std::uint8_t>(static_cast<float>(a) * r[k]));
        given.push_back(static_cast<std::uint8_t>(a));
        known.push_back(i > 0 && r[4] < 0.3f ? 0 : r[4] < 0.6f ? 1 : 255);
        for (int k = 1; k < 4; ++k) colour.push_back(2 * r[k + 3] - 0.5f);
        float off = (r[0] - 0.5f) * (i % 2 == 0 ? 3.0f : 200.0f);
        if (std::abs(std::abs(off) - 0.5f) < 1e-2f) off += 0.1f;
        alpha.push_back((static_cast<float>(a) + off) / 255);
      }
      std::vector<double> target, dalpha;
      for (std::size_t i = 0; i < n; ++i) {
        std::array<double, 3> background{}, drawn{};
        for (std::size_t k = 0; k < 3; ++k) background[k] = kBehindPictures[k], drawn[k] = colour[3 * i + k];
        const auto want = ref::pixel_target(&given[4 * i], !masked || known[i] != 0, background, drawn, alpha[i],
                                            static_cast<double>(0.3f) / static_cast<double>(n));
        target.insert(target.end(), want.colour.begin(), want.colour.end());
        dalpha.push_back(want.dalpha);
      }
      PictureTarget a;
      a.given = c.ctx.upload({h, w, 4}, given, Type::u8);
      if (masked) a.known = c.ctx.upload({h, w}, known, Type::u8);
      a.background = kBehindPictures, a.alpha_weight = 0.3f;
      a.drawn.colour = c.up({h, w, 3}, colour), a.drawn.alpha = c.up({h, w}, alpha);
      a.target = c.gap({h, w, 3}), a.dalpha = c.gap({h, w});
      picture_target(c.ctx, a);
      c.close("target", a.target, target, 1e-6);
      c.close("gradient of alpha", a.dalpha, dalpha, 1e-6);
      if (!c.all) continue;
      PictureTarget alone = a;
      alone.dalpha = {}, alone.target = c.gap({h, w, 3});
      picture_target(c.ctx, alone);
      c.equal("target alone", alone.target, c.ctx.read<float>(a.target));
    }
}

}  // namespace

VSPLAT_CASES(picture_target, {"picture_target", picture_target_all})

}  // namespace vsplat::selftest
