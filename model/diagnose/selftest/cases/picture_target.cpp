#include "model/diagnose/selftest/reference/picture_target.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/given_pictures.h"
#include "model/ops/fit/picture_target.h"

namespace vsplat::selftest {
namespace {

void picture_target_all(Checks& c) {
  for (const auto& [h, w] :
       c.some({std::array<long, 2>{1, 1}, {3, 1}, {7, 9}, {8, 8}, {5, 13}, {31, 37}}, {{0, 0}, {0, 5}}))
    for (const bool masked : c.some({true}, {false})) {
      const std::size_t n = size_of(h, w);
      const auto [given, known, colour, alpha] = given_picture(h, w);
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
