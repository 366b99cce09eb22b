#include "model/ops/dense/conv3d_up.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/conv3d_up.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class Conv3dUp : public test::FlavourTest {
 protected:
  void check(std::size_t x, std::size_t y, std::size_t z, std::size_t cin, std::size_t cout, bool biased) {
    SCOPED_TRACE(fmt::format("{} x {} x {}, {} to {}", x, y, z, cin, cout));
    ref::Conv3dUpCase in;
    in.x = x, in.y = y, in.z = z, in.cin = cin, in.cout = cout;
    const std::size_t voxels = x * y * z;
    in.in = test::random_floats(voxels * cin, 1), in.w = test::random_floats(cin * cout * 8, 2);
    if (biased) in.bias = test::random_floats(cout, 3);
    const auto i = [](std::size_t n) { return static_cast<long>(n); };
    const Tensor w = ctx().upload({i(cin), i(cout), 2, 2, 2}, in.w), rows = ctx().upload({i(voxels), i(cin)}, in.in);
    Conv3dUpForward f;
    f.in = rows;
    f.x = i(x), f.y = i(y), f.z = i(z);
    if (biased) f.bias = ctx().upload({i(cout)}, in.bias);
    const Shape shape{8 * i(voxels), i(cout)};
    std::vector<float> got[2];
    for (const bool from_host : {true, false}) {
      const PackedMatrix packed =
          from_host ? pack_conv3d_up(ctx(), in.w.data(), i(cin), i(cout), "w") : pack_conv3d_up(ctx(), w, "w");
      f.weights = &packed;
      f.out = ctx().upload(shape, test::nans(8 * voxels * cout));
      conv3d_up_forward(ctx(), f);
      got[from_host] = ctx().read<float>(f.out);
    }
    EXPECT_TRUE(test::close(got[0], in.forward(), 1e-5));
    EXPECT_EQ(got[0], got[1]) << "packed on the host and on the device";

    const auto dy = test::random_floats(8 * voxels * cout, 4), dw = test::random_floats(in.w.size(), 5);
    const auto dbias = test::random_floats(cout, 6);
    ref::Conv3dUpCase::Gradients want = in.backward(dy);
    for (std::size_t k = 0; k < dw.size(); ++k) want.w[k] += dw[k];
    for (std::size_t k = 0; k < cout; ++k) want.bias[k] += dbias[k];
    Conv3dUpBackward b;
    b.in = rows;
    b.x = f.x, b.y = f.y, b.z = f.z;
    b.w = w;
    b.dy = ctx().upload(shape, dy);
    b.dx = ctx().upload(rows.shape(), test::nans(voxels * cin));
    b.dw = ctx().upload(w.shape(), dw);
    if (biased) b.dbias = ctx().upload({i(cout)}, dbias);
    conv3d_up_backward(ctx(), b);
    EXPECT_TRUE(test::close(ctx().read<float>(b.dx), want.in, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(b.dw), want.w, 1e-5));
    if (biased) {
      EXPECT_TRUE(test::close(ctx().read<float>(b.dbias), want.bias, 1e-5));
    }
  }
};
VSPLAT_FLAVOURS(Conv3dUp);

TEST_P(Conv3dUp, MatchesReference) {
  check(1, 1, 1, 1, 1, true);
  check(2, 3, 5, 7, 3, true);
  check(3, 1, 2, 16, 12, false);
  check(5, 5, 5, 33, 17, true);
}

// More voxels than come at a time, of which the last are fewer.
TEST_P(Conv3dUp, InBlocks) { check(3, 5, 7, 2, 9001, true); }

TEST_P(Conv3dUp, RejectsBadShape) {
  const PackedMatrix packed = pack_conv3d_up(ctx(), ctx().upload({4, 3, 2, 2, 2}, std::vector<float>(96)), "w");
  Conv3dUpForward f;
  f.in = ctx().tensor({8, 4});
  f.x = f.y = f.z = 2;
  f.weights = &packed;
  f.out = ctx().tensor({64, 4});
  EXPECT_THROW(conv3d_up_forward(ctx(), f), Error) << "room for 4 channels of 3";
  f.out = ctx().tensor({8, 3});
  EXPECT_THROW(conv3d_up_forward(ctx(), f), Error);
}

}  // namespace
}  // namespace vsplat
