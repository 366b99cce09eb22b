#include "model/ops/dense/conv3d.h"

#include <gtest/gtest.h>

#include "tests/support/compare.h"
#include "tests/support/conv3d_cases.h"
#include "tests/support/counted.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using test::ConvTry;
using test::make_conv_case;
using test::random_floats;
using test::upload_rows;
using Way = test::ConvWay;

const float* or_null(const std::vector<float>& v) { return v.empty() ? nullptr : v.data(); }

struct OnDevice {
  ConvWeights weights;
  Conv3dForward c;
};

std::unique_ptr<OnDevice> upload_case(Context& ctx, const ref::ConvCase& c, ConvMethod method) {
  auto d = std::make_unique<OnDevice>();
  d->weights = pack_conv3d(ctx, c.w.data(), or_null(c.bias), c.cout, c.in.c0 + c.in.c1, "weight", method);
  d->c.weights = &d->weights;
  d->c.in = upload_rows(ctx, c.in);
  d->c.x = c.size[0], d->c.y = c.size[1], d->c.z = c.size[2];
  if (!c.residual.empty()) d->c.residual = ctx.upload({c.in.rows, c.cout}, c.residual);
  d->c.out = ctx.upload({c.in.rows, c.cout},
                        test::nans(static_cast<std::size_t>(c.in.rows) * static_cast<std::size_t>(c.cout)));
  return d;
}

class Conv3dTest : public ::testing::TestWithParam<Way> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
  std::unique_ptr<OnDevice> upload(Context& on, const ref::ConvCase& c) {
    return upload_case(on, c, GetParam().method);
  }
  // float32 sums of 27 Cin products, up to some 2000, err by about 1e-7 of the largest times the square root of that;
  // Winograd's transforms triple it.
  double tolerance() const { return GetParam().method == ConvMethod::winograd ? 2e-5 : 1e-5; }
};

// More planes than are packed at a time, so that the ring of planes goes round.
TEST_P(Conv3dTest, LongVolumesGoRoundTheRing) {
  // The cpu flavour packs seven planes of 1040 channels at a time, or eight tiles; the gpu flavour 27 tiles of 30 with
  // 1200 channels, and for the direct sum nothing.
  const bool gpu = GetParam().flavour == Flavour::gpu;
  ConvTry t{{11, 40, 12}, !gpu ? 1040 : GetParam().method == ConvMethod::winograd ? 1200 : 26, 3};
  t.affine = t.silu = true;
  const ref::ConvCase c = make_conv_case(t);
  const auto d = upload(ctx(), c);
  conv3d_forward(ctx(), d->c);
  const auto got = ctx().read<float>(d->c.out);
  std::vector<float> some;
  std::vector<double> want;
  for (long x = 0; x < 11; ++x)
    for (long y = x % 3; y < 40; y += 13)
      for (long z = 0; z < 12; z += 5)
        for (long n = 0; n < 3; ++n) {
          some.push_back(got[static_cast<std::size_t>(((x * 40 + y) * 12 + z) * 3 + n)]);
          want.push_back(c.at(x, y, z, n));
        }
  EXPECT_TRUE(test::close(some, want, tolerance()));
}

TEST_P(Conv3dTest, RejectsWeightsOfAnotherShape) {
  for (const Shape& shape : {Shape{4, 5, 27}, Shape{4, 5, 3, 3, 2}, Shape{4, 5, 2, 2, 2}})
    EXPECT_THROW(pack_conv3d(ctx(), ctx().tensor(shape), Tensor(), "weight", GetParam().method), Error);
}

// Winograd's method performs a quarter of the operations if its tiles of 4 x 4 lines fill the volume.
TEST_P(Conv3dTest, ProfilesTellTheDirectOperationsAndThosePerformed) {
  const ref::ConvCase c = make_conv_case({{8, 4, 12}, 16, 32});
  const auto d = upload(ctx(), c);
  const ProfileRow row = test::profiled_row(ctx(), d->c.name, [&] { conv3d_forward(ctx(), d->c); });
  EXPECT_DOUBLE_EQ(row.flops, 54.0 * 8 * 4 * 12 * 16 * 32);
  EXPECT_DOUBLE_EQ(row.performed_flops, row.flops / (GetParam().method == ConvMethod::winograd ? 4 : 1));
}

TEST_P(Conv3dTest, PlanTakesTheSameMemory) {
  const ref::ConvCase c = make_conv_case({{11, 40, 12}, 40, 6});
  const auto own = test::open_context(GetParam().flavour);
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) conv3d_forward(*at, upload(*at, c)->c);
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(Conv3dTest, RejectsBadShapes) {
  const ref::ConvCase c = make_conv_case({{3, 4, 5}, 6, 7});
  const auto d = upload(ctx(), c);
  const auto rejects = [&](auto change) {
    Conv3dForward bad = d->c;
    change(bad);
    EXPECT_THROW(conv3d_forward(ctx(), bad), Error);
  };
  rejects([](Conv3dForward& b) { b.weights = nullptr; });
  rejects([](Conv3dForward& b) { b.in.x0 = Tensor(); });
  rejects([](Conv3dForward& b) { b.z = 6; });
  rejects([&](Conv3dForward& b) { b.in.x1 = ctx().tensor({60, 1}); });
  rejects([&](Conv3dForward& b) { b.in.scale = ctx().tensor({6}); });
  rejects([&](Conv3dForward& b) { b.residual = ctx().tensor({60, 6}); });
  rejects([&](Conv3dForward& b) { b.out = ctx().tensor({59, 7}); });
  rejects([](Conv3dForward& b) { b.out = Tensor(); });
}

class Conv3d : public test::FlavourTest {};
VSPLAT_FLAVOURS(Conv3d);
VSPLAT_OPERATION(Conv3d, conv3d)

INSTANTIATE_TEST_SUITE_P(Kernels, Conv3dTest, test::conv_ways(), test::name_of_way);

// Left to itself, a flavour takes Winograd's method where there is enough to do.
TEST(Conv3dMethod, IsChosenBySize) {
  const std::vector<float> w(27 * 64 * 64, 1.0f);
  Context &cpu = test::context(Flavour::cpu), &gpu = test::context(Flavour::gpu);
  EXPECT_TRUE(pack_conv3d(cpu, w.data(), nullptr, 32, 32, "w").winograd);
  EXPECT_FALSE(pack_conv3d(cpu, w.data(), nullptr, 16, 32, "w").winograd);
  EXPECT_FALSE(pack_conv3d(gpu, w.data(), nullptr, 32, 32, "w").winograd);
  EXPECT_TRUE(pack_conv3d(gpu, w.data(), nullptr, 64, 64, "w").winograd);
  EXPECT_FALSE(pack_conv3d(gpu, w.data(), nullptr, 64, 63, "w").winograd);
}

}  // namespace
}  // namespace vsplat
