#include "model/ops/networks/ray_harmonics.h"

#include "model/diagnose/selftest/reference/ray_harmonics.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RayHarmonics : public test::FlavourTest {};
VSPLAT_FLAVOURS(RayHarmonics);
VSPLAT_OPERATION(RayHarmonics, ray_harmonics)

// Directions of any length, because predicted rays are not normalised.
TEST_P(RayHarmonics, MatchesReferenceAndItsDifferences) {
  for (const long r : {1L, 3L, 7L, 63L, 64L, 65L, 211L}) {
    const auto count = static_cast<std::size_t>(r);
    const auto rays = test::random_floats(count * 6, 1, -2, 2), dy = test::random_floats(count * 32, 2);
    const std::vector<double> at(rays.begin(), rays.end());
    const Tensor x = ctx().upload({r, 6}, rays), y = ctx().upload({r, 32}, test::nans(count * 32));
    ray_harmonics_forward(ctx(), {x, y});
    EXPECT_TRUE(test::close(ctx().read<float>(y), ref::ray_harmonics(at), 1e-6)) << r;
    const Tensor dx = ctx().upload({r, 6}, test::nans(count * 6));
    ray_harmonics_backward(ctx(), {x, ctx().upload({r, 32}, dy), dx});
    EXPECT_TRUE(test::close(ctx().read<float>(dx), ref::ray_harmonics_gradient(at, dy), 1e-6)) << r;
  }
}

TEST_P(RayHarmonics, EmptyAndBadShape) {
  ray_harmonics_forward(ctx(), {ctx().tensor({0, 6}), ctx().tensor({0, 32})});
  EXPECT_THROW(ray_harmonics_forward(ctx(), {ctx().tensor({2, 6}), ctx().tensor({2, 16})}), Error);
  EXPECT_THROW(ray_harmonics_backward(ctx(), {ctx().tensor({2, 6}), ctx().tensor({3, 32}), ctx().tensor({2, 6})}),
               Error);
}

}  // namespace
}  // namespace vsplat
