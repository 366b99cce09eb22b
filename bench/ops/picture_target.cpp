#include "model/ops/fit/picture_target.h"

#include "bench/ops/operation.h"

namespace vsplat::bench {

std::vector<Case> picture_target_cases(const Options&) {
  return {
      {"masked",
       [](Context& ctx) {
         std::vector<std::uint8_t> given(4 * kImage * kImage), known(kImage * kImage);
         std::mt19937 engine(1);
         for (std::uint8_t& v : given) v = static_cast<std::uint8_t>(engine());
         for (std::uint8_t& v : known) v = engine() % 8 != 0;
         PictureTarget a;
         a.given = ctx.upload({kImage, kImage, 4}, given, Type::u8);
         a.known = ctx.upload({kImage, kImage}, known, Type::u8);
         a.drawn = {random(ctx, {kImage, kImage, 3}, 1, 0, 1), random(ctx, {kImage, kImage}, 2, 0, 1),
                    random(ctx, {kImage, kImage}, 3, 0, 1)};
         a.alpha_weight = 0.1f;
         a.target = ctx.tensor({kImage, kImage, 3}), a.dalpha = ctx.tensor({kImage, kImage});
         return operation(ctx, [&ctx, a] { picture_target(ctx, a); }, {a.target, a.dalpha});
       }},
  };
}

}  // namespace vsplat::bench
