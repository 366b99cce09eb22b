#include "model/ops/resample3d.h"

#include "tests/reference/resample3d.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class Resample3d : public test::FlavourTest {};
VSPLAT_FLAVOURS(Resample3d);

TEST_P(Resample3d, UpsamplingMatchesReference) {
  struct Size {
    long d, h, w, c;
  };
  for (const auto& [d, h, w, c] :
       {Size{1, 1, 1, 1}, {1, 2, 3, 5}, {2, 3, 1, 16}, {3, 2, 5, 19}, {4, 4, 4, 33}, {2, 2, 2, 130}}) {
    const std::vector<float> x = test::random_floats(static_cast<std::size_t>(d * h * w * c), 21);
    const Tensor out = ctx().upload({8 * d * h * w, c}, test::nans(8 * x.size()));
    upsample3d_forward(ctx(), {ctx().upload({d * h * w, c}, x), d, h, w, out});
    EXPECT_TRUE(test::close(ctx().read<float>(out), ref::upsample3d(x, d, h, w, c), 1e-6))
        << d << " " << h << " " << w << " " << c;
  }
}

TEST_P(Resample3d, RejectsBadShape) {
  EXPECT_THROW(upsample3d_forward(ctx(), {ctx().tensor({8, 3}), 2, 2, 2, ctx().tensor({64, 4})}), Error);
  EXPECT_THROW(upsample3d_forward(ctx(), {ctx().tensor({8, 3}), 2, 2, 2, ctx().tensor({8, 3})}), Error);
}

}  // namespace
}  // namespace vsplat
