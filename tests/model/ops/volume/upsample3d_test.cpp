#include "model/ops/volume/upsample3d.h"

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Resample3d : public test::FlavourTest {};
VSPLAT_FLAVOURS(Resample3d);
VSPLAT_OPERATION(Resample3d, upsample3d)

// <up(x), dy> = <x, back(dy)>, at a size that the reference would take long for.
TEST_P(Resample3d, BackwardIsTheTranspose) {
  const long d = 5, h = 7, w = 6, c = 130;
  const std::vector<float> x = test::random_floats(static_cast<std::size_t>(d * h * w * c), 23);
  const std::vector<float> dy = test::random_floats(8 * x.size(), 24);
  const Tensor y = ctx().upload({8 * d * h * w, c}, test::nans(dy.size()));
  const Tensor dx = ctx().upload({d * h * w, c}, test::nans(x.size()));
  upsample3d_forward(ctx(), {ctx().upload({d * h * w, c}, x), d, h, w, y});
  upsample3d_backward(ctx(), {ctx().upload({8 * d * h * w, c}, dy), d, h, w, dx});
  const std::vector<float> up = ctx().read<float>(y), back = ctx().read<float>(dx);
  double forward = 0, backward = 0, scale = 0;
  for (std::size_t i = 0; i < dy.size(); ++i) forward += static_cast<double>(up[i]) * dy[i];
  for (std::size_t i = 0; i < x.size(); ++i) {
    backward += static_cast<double>(x[i]) * back[i];
    scale += std::abs(static_cast<double>(x[i]) * back[i]);
  }
  EXPECT_NEAR(forward, backward, 1e-7 * scale);
}

TEST_P(Resample3d, RejectsBadShape) {
  EXPECT_THROW(upsample3d_backward(ctx(), {ctx().tensor({64, 4}), 2, 2, 2, ctx().tensor({8, 3})}), Error);
  EXPECT_THROW(upsample3d_backward(ctx(), {ctx().tensor({8, 3}), 2, 2, 2, ctx().tensor({8, 3})}), Error);
  EXPECT_THROW(upsample3d_forward(ctx(), {ctx().tensor({8, 3}), 2, 2, 2, ctx().tensor({64, 4})}), Error);
  EXPECT_THROW(upsample3d_forward(ctx(), {ctx().tensor({8, 3}), 2, 2, 2, ctx().tensor({8, 3})}), Error);
}

}  // namespace
}  // namespace vsplat
