#include "model/ops/conv3d.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/ops/sparse_conv.h"
#include "tests/reference/conv3d.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::random_floats;

struct Try {
  std::array<long, 3> size;
  long cin, cout;
  long c1 = 0;
  bool affine = false, silu = false, bias = true, residual = false;
};

ref::ConvCase make_case(const Try& t, long side = 3, std::uint32_t seed = 1) {
  ref::ConvCase c;
  c.size = t.size, c.side = side, c.cout = t.cout;
  if (side == 2) c.stride = 2, c.padding = 0;
  const auto voxels = static_cast<std::size_t>(t.size[0] * t.size[1] * t.size[2]);
  const auto channels = static_cast<std::size_t>(t.cin + t.c1), outs = static_cast<std::size_t>(t.cout);
  c.in.rows = static_cast<long>(voxels), c.in.c0 = t.cin, c.in.c1 = t.c1, c.in.silu = t.silu;
  c.in.x0 = random_floats(voxels * static_cast<std::size_t>(t.cin), seed);
  c.in.x1 = random_floats(voxels * static_cast<std::size_t>(t.c1), seed + 1);
  if (t.affine) {
    c.in.scale = random_floats(channels, seed + 2, 0.5f, 2.0f);
    c.in.shift = random_floats(channels, seed + 3);
  }
  c.w = random_floats(outs * channels * static_cast<std::size_t>(side * side * side), seed + 4);
  if (t.bias) c.bias = random_floats(outs, seed + 5);
  const auto out = c.out_size();
  if (t.residual) c.residual = random_floats(static_cast<std::size_t>(out[0] * out[1] * out[2]) * outs, seed + 6);
  return c;
}

RowSource upload_rows(Context& ctx, const ref::Rows& in) {
  RowSource out;
  out.x0 = ctx.upload({in.rows, in.c0}, in.x0);
  if (in.c1) out.x1 = ctx.upload({in.rows, in.c1}, in.x1);
  if (!in.scale.empty()) {
    out.scale = ctx.upload({in.c0 + in.c1}, in.scale);
    out.shift = ctx.upload({in.c0 + in.c1}, in.shift);
  }
  out.silu = in.silu;
  return out;
}

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

struct Way {
  Flavour flavour;
  ConvMethod method;
};

class Conv3dTest : public ::testing::TestWithParam<Way> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
  std::unique_ptr<OnDevice> upload(Context& on, const ref::ConvCase& c) {
    return upload_case(on, c, GetParam().method);
  }
  // float32 sums of 27 Cin products, up to some 2000, err by about 1e-7 of the largest times the square root of that;
  // Winograd's transforms triple it.
  double tolerance() const { return GetParam().method == ConvMethod::winograd ? 2e-5 : 1e-5; }

  void expect_matches(const Try& t) {
    SCOPED_TRACE(fmt::format("{}x{}x{} {}+{} -> {} affine {} silu {} bias {} residual {}", t.size[0], t.size[1],
                             t.size[2], t.cin, t.c1, t.cout, t.affine, t.silu, t.bias, t.residual));
    const ref::ConvCase c = make_case(t);
    const auto d = upload(ctx(), c);
    conv3d_forward(ctx(), d->c);
    EXPECT_TRUE(test::close(ctx().read<float>(d->c.out), c.all(), tolerance()));
  }
};

TEST_P(Conv3dTest, EverySizeMatchesReference) {
  for (const long z : {1, 2, 4, 5, 10, 11, 12, 13, 24, 25}) expect_matches({{3, 2, z}, 3, 5});
  for (const long x : {1, 2, 3, 7})
    for (const long y : {1, 2, 5}) expect_matches({{x, y, 4}, 3, 5});
  for (const long cin : {1, 7, 16, 17, 33})
    for (const long cout : {1, 15, 16, 31, 32, 33, 65}) expect_matches({{3, 3, 5}, cin, cout});
}

TEST_P(Conv3dTest, EveryCompositionMatchesReference) {
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true}) {
        Try t{{4, 3, 13}, 16, 20, c1};
        t.affine = affine, t.silu = silu;
        expect_matches(t);
        t.bias = false, t.residual = true;
        expect_matches(t);
      }
}

// More planes than are packed at a time, so that the ring of planes goes round.
TEST_P(Conv3dTest, LongVolumesGoRoundTheRing) {
  // Only the cpu flavour packs: of planes of 1040 channels it does seven at a time, of tiles eight.
  Try t{{11, 40, 12}, GetParam().flavour == Flavour::cpu ? 1040 : 26, 3};
  t.affine = t.silu = true;
  const ref::ConvCase c = make_case(t);
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

// Weights packed on the device are those packed on the host; only Winograd's are computed, in float rather than double.
TEST_P(Conv3dTest, PacksTheSameOnTheDevice) {
  for (const auto& [cin, cout] : {std::pair{1L, 1L}, {7L, 5L}, {17L, 32L}, {5L, 33L}}) {
    const ref::ConvCase c = make_case({{1, 1, 1}, cin, cout});
    const ConvMethod method = GetParam().method;
    const ConvWeights host = pack_conv3d(ctx(), c.w.data(), c.bias.data(), cout, cin, "weight", method);
    const ConvWeights device = pack_conv3d(ctx(), ctx().upload({cout, cin, 3, 3, 3}, c.w), host.bias, "weight", method);
    const auto got = ctx().read<float>(device.w.data), want = ctx().read<float>(host.w.data);
    if (method == ConvMethod::winograd)
      EXPECT_TRUE(test::close(got, want, 1e-6)) << cin << " " << cout;
    else
      EXPECT_EQ(got, want) << cin << " " << cout;
    EXPECT_EQ(device.w.k, host.w.k);
    EXPECT_EQ(device.w.n, host.w.n);
    EXPECT_EQ(device.cin, cin);
    EXPECT_EQ(device.cout, cout);
    EXPECT_EQ(ctx().read<float>(device.bias), c.bias);
  }
}

TEST_P(Conv3dTest, BackwardByInputsMatchesReference) {
  for (const std::array<long, 3>& size :
       {std::array<long, 3>{1, 1, 1}, {2, 3, 1}, {3, 5, 13}, {4, 1, 12}, {7, 4, 2}, {5, 9, 65}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {7L, 5L}, {33L, 17L}, {16L, 32L}, {5L, 65L}}) {
      const ref::ConvCase c = make_case({size, cin, cout});
      const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * cout), 71);
      Conv3dBackwardInputs g;
      g.w = ctx().upload({cout, cin, 3, 3, 3}, c.w);
      g.x = size[0], g.y = size[1], g.z = size[2];
      g.dy = ctx().upload({c.in.rows, cout}, dy);
      g.dx = ctx().upload({c.in.rows, cin}, test::nans(static_cast<std::size_t>(c.in.rows * cin)));
      g.method = GetParam().method;
      conv3d_backward_inputs(ctx(), g);
      EXPECT_TRUE(test::close(ctx().read<float>(g.dx), ref::conv_backward(c, dy).dx, tolerance()))
          << size[0] << "x" << size[1] << "x" << size[2] << " " << cin << " -> " << cout;
    }
}

TEST_P(Conv3dTest, RejectsWeightsOfAnotherShape) {
  for (const Shape& shape : {Shape{4, 5, 27}, Shape{4, 5, 3, 3, 2}, Shape{4, 5, 2, 2, 2}}) {
    EXPECT_THROW(pack_conv3d(ctx(), ctx().tensor(shape), Tensor(), "weight", GetParam().method), Error);
    Conv3dBackwardInputs g;
    g.w = ctx().tensor(shape);
    g.x = g.y = g.z = 1;
    g.dy = ctx().tensor({1, 4}), g.dx = ctx().tensor({1, 5});
    g.method = GetParam().method;
    EXPECT_THROW(conv3d_backward_inputs(ctx(), g), Error);
  }
}

TEST_P(Conv3dTest, ResidualMayBeTheOutput) {
  Try t{{3, 4, 13}, 5, 33};
  t.residual = true;
  const ref::ConvCase c = make_case(t);
  const auto d = upload(ctx(), c);
  d->c.out = d->c.residual;
  conv3d_forward(ctx(), d->c);
  EXPECT_TRUE(test::close(ctx().read<float>(d->c.out), c.all(), tolerance()));
}

TEST_P(Conv3dTest, EmptyIsNothing) {
  const ref::ConvCase c = make_case({{0, 3, 4}, 5, 6});
  const auto d = upload(ctx(), c);
  conv3d_forward(ctx(), d->c);
  EXPECT_EQ(ctx().read<float>(d->c.out).size(), 0u);
}

TEST_P(Conv3dTest, DownMatchesReference) {
  for (const std::array<long, 3>& size : {std::array<long, 3>{2, 2, 2}, {4, 6, 8}, {5, 3, 7}, {1, 4, 4}})
    for (const long cin : {1L, 17L}) {
      Try t{size, cin, 33};
      t.affine = t.silu = cin > 1;
      const ref::ConvCase c = make_case(t, 2);
      const auto out = c.out_size();
      const long rows = out[0] * out[1] * out[2];
      Conv3dDownForward d;
      const ConvWeights weights = pack_conv3d_down(ctx(), c.w.data(), c.bias.data(), c.cout, cin, "weight");
      d.weights = &weights;
      d.in = upload_rows(ctx(), c.in);
      d.in.map = conv3d_down_map(ctx(), size[0], size[1], size[2]);
      d.out = ctx().upload({rows, c.cout}, test::nans(static_cast<std::size_t>(rows * c.cout)));
      conv3d_down_forward(ctx(), d);
      EXPECT_TRUE(test::close(ctx().read<float>(d.out), c.all(), tolerance()));
      const ConvWeights on_device =
          pack_conv3d_down(ctx(), ctx().upload({c.cout, cin, 2, 2, 2}, c.w), weights.bias, "weight");
      EXPECT_EQ(ctx().read<float>(on_device.w.data), ctx().read<float>(weights.w.data));
      EXPECT_EQ(on_device.cin, cin);
      EXPECT_EQ(on_device.cout, c.cout);
    }
}

// A submanifold convolution over all voxels of a volume is the dense one.
TEST_P(Conv3dTest, SubmanifoldOverAFullVolumeIsTheDenseOne) {
  const ref::ConvCase c = make_case({{3, 4, 5}, 9, 10});
  const long voxels = c.in.rows, cin = c.in.c0;
  std::vector<float> w(c.w.size());
  for (long n = 0; n < c.cout; ++n)
    for (long tap = 0; tap < 27; ++tap)
      for (long ch = 0; ch < cin; ++ch)
        w[static_cast<std::size_t>((n * 27 + tap) * cin + ch)] =
            c.w[static_cast<std::size_t>((n * cin + ch) * 27 + tap)];
  std::vector<int> map;
  for (long v = 0; v < voxels; ++v)
    for (long tap = 0; tap < 27; ++tap) {
      const long x = v / 20 + tap / 9 - 1, y = v / 5 % 4 + tap / 3 % 3 - 1, z = v % 5 + tap % 3 - 1;
      const bool inside = x >= 0 && x < 3 && y >= 0 && y < 4 && z >= 0 && z < 5;
      map.push_back(inside ? static_cast<int>((x * 4 + y) * 5 + z) : static_cast<int>(voxels));
    }
  const ConvWeights weights = pack_submanifold(ctx(), w.data(), c.bias.data(), c.cout, 27, cin, "weight");
  SubmanifoldForward g;
  g.in = upload_rows(ctx(), c.in);
  g.in.map = ctx().upload({voxels, 27}, map, Type::i32);
  g.weights = &weights;
  g.out = ctx().tensor({voxels, c.cout});
  submanifold_forward(ctx(), g);
  EXPECT_TRUE(test::close(ctx().read<float>(g.out), c.all(), tolerance()));
}

TEST_P(Conv3dTest, SameBitsTwice) {
  Try t{{5, 6, 13}, 20, 40, 12};
  t.affine = t.silu = t.residual = true;
  const ref::ConvCase c = make_case(t);
  const auto d = upload(ctx(), c);
  conv3d_forward(ctx(), d->c);
  const auto first = ctx().read<float>(d->c.out);
  ctx().write(d->c.out, test::nans(first.size()).data());
  conv3d_forward(ctx(), d->c);
  EXPECT_EQ(ctx().read<float>(d->c.out), first);
}

TEST_P(Conv3dTest, PlanTakesTheSameMemory) {
  const ref::ConvCase c = make_case({{11, 40, 12}, 40, 6});
  const auto own = test::open_context(GetParam().flavour);
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) conv3d_forward(*at, upload(*at, c)->c);
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(Conv3dTest, RejectsBadShapes) {
  const ref::ConvCase c = make_case({{3, 4, 5}, 6, 7});
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

class Conv3dDownBackwardTest : public test::FlavourTest {};
VSPLAT_FLAVOURS(Conv3dDownBackwardTest);

// All three are added to: the gradients start from something else, and dx keeps it where no patch is.
TEST_P(Conv3dDownBackwardTest, MatchesReference) {
  for (const std::array<long, 3>& size : {std::array<long, 3>{2, 2, 2}, {1, 4, 4}, {5, 3, 7}, {16, 12, 26}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {3L, 7L}, {17L, 33L}}) {
      Try t{size, cin, cout};
      t.affine = t.silu = cin > 1;
      const ref::ConvCase c = make_case(t, 2);
      const auto out = c.out_size();
      const long rows = out[0] * out[1] * out[2];
      const std::vector<float> dy = random_floats(static_cast<std::size_t>(rows * cout), 71);
      ref::ConvGradient want = ref::conv_backward(c, dy);
      const auto from = [&](std::vector<double>& values, const Shape& shape, std::uint32_t seed) {
        const std::vector<float> before = random_floats(values.size(), seed, 1, 2);
        for (std::size_t i = 0; i < values.size(); ++i) values[i] += before[i];
        return ctx().upload(shape, before);
      };
      Conv3dDownBackward g;
      g.in = upload_rows(ctx(), c.in);
      g.in.map = conv3d_down_map(ctx(), size[0], size[1], size[2]);
      g.w = ctx().upload({cout, cin, 2, 2, 2}, c.w);
      g.dy = ctx().upload({rows, cout}, dy);
      g.dx = from(want.dx, {c.in.rows, cin}, 72);
      g.dw = from(want.dw, {cout, cin, 2, 2, 2}, 73);
      g.dbias = from(want.dbias, {cout}, 74);
      conv3d_down_backward(ctx(), g);
      SCOPED_TRACE(fmt::format("{}x{}x{} {} -> {}", size[0], size[1], size[2], cin, cout));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dx), want.dx, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dw), want.dw, 1e-5));
      EXPECT_TRUE(test::close(ctx().read<float>(g.dbias), want.dbias, 1e-5));
    }
}

TEST_P(Conv3dDownBackwardTest, RejectsBadShapes) {
  Conv3dDownBackward g;
  g.in.x0 = ctx().tensor({64, 3});
  g.in.map = conv3d_down_map(ctx(), 4, 4, 4);
  g.w = g.dw = ctx().tensor({5, 3, 2, 2, 2});
  g.dy = ctx().tensor({8, 5});
  const auto rejects = [&](auto change) {
    Conv3dDownBackward bad = g;
    change(bad);
    EXPECT_THROW(conv3d_down_backward(ctx(), bad), Error);
  };
  rejects([](Conv3dDownBackward& b) { b.in.map = Tensor(); });
  rejects([&](Conv3dDownBackward& b) { b.dy = ctx().tensor({7, 5}); });
  rejects([&](Conv3dDownBackward& b) { b.dw = ctx().tensor({5, 3, 2, 4}); });
  rejects([&](Conv3dDownBackward& b) { b.dx = ctx().tensor({63, 3}); });
  rejects([&](Conv3dDownBackward& b) { b.in.x0 = ctx().tensor({64, 2}); });
  EXPECT_THROW(pack_conv3d_down(ctx(), ctx().tensor({5, 3, 3, 3, 3}), Tensor(), "weight"), Error);
}

class Conv3dWeights : public ::testing::TestWithParam<Way> {
 protected:
  Context& ctx() { return test::context(GetParam().flavour); }
  double tolerance() const { return GetParam().method == ConvMethod::winograd ? 2e-5 : 1e-5; }
  static std::vector<float> zeros(std::size_t count) { return std::vector<float>(count, 0.0f); }

  Conv3dBackwardWeights upload(Context& on, const ref::ConvCase& c, const std::vector<float>& dy) {
    Conv3dBackwardWeights g;
    g.in = upload_rows(on, c.in);
    g.x = c.size[0], g.y = c.size[1], g.z = c.size[2];
    g.dy = on.upload({c.in.rows, c.cout}, dy);
    g.dw = on.upload({c.cout, c.in.c0 + c.in.c1, 3, 3, 3}, zeros(c.w.size()));
    g.dbias = on.upload({c.cout}, zeros(static_cast<std::size_t>(c.cout)));
    g.method = GetParam().method;
    return g;
  }

  void expect_matches(const Try& t) {
    SCOPED_TRACE(fmt::format("{}x{}x{} {}+{} -> {} affine {} silu {}", t.size[0], t.size[1], t.size[2], t.cin, t.c1,
                             t.cout, t.affine, t.silu));
    const ref::ConvCase c = make_case(t);
    const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * t.cout), 73);
    const Conv3dBackwardWeights g = upload(ctx(), c, dy);
    conv3d_backward_weights(ctx(), g);
    const ref::ConvGradient want = ref::conv_backward(c, dy);
    EXPECT_TRUE(test::close(ctx().read<float>(g.dw), want.dw, tolerance()));
    EXPECT_TRUE(test::close(ctx().read<float>(g.dbias), want.dbias, 1e-5));
  }
};

TEST_P(Conv3dWeights, EverySizeMatchesReference) {
  for (const std::array<long, 3>& size :
       {std::array<long, 3>{1, 1, 1}, {1, 2, 3}, {3, 5, 13}, {4, 1, 12}, {7, 4, 2}, {5, 9, 65}})
    for (const auto& [cin, cout] : {std::pair{1L, 1L}, {7L, 5L}, {11L, 31L}, {12L, 32L}, {13L, 33L}, {65L, 67L}})
      expect_matches({size, cin, cout});
}

TEST_P(Conv3dWeights, EveryCompositionMatchesReference) {
  for (const long c1 : {0L, 5L, 16L})
    for (const bool affine : {false, true})
      for (const bool silu : {false, true}) {
        Try t{{4, 3, 7}, 17, 20, c1};
        t.affine = affine, t.silu = silu;
        expect_matches(t);
      }
}

// Several chunks, the last of them shorter than the others.
TEST_P(Conv3dWeights, ManyVoxelsMatchReference) {
  expect_matches({{13, 19, 17}, 3, 5});
  expect_matches({{2, 3, 1100}, 2, 1});
}

// What is there stays; a bias is not needed; the same bits each time.
TEST_P(Conv3dWeights, AddsAndRepeats) {
  const ref::ConvCase c = make_case({{12, 12, 16}, 9, 10});
  const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * 10), 74);
  Conv3dBackwardWeights g = upload(ctx(), c, dy);
  conv3d_backward_weights(ctx(), g);
  const std::vector<float> once = ctx().read<float>(g.dw), bias = ctx().read<float>(g.dbias);
  conv3d_backward_weights(ctx(), g);
  std::vector<float> twice = once;
  for (float& v : twice) v += v;
  EXPECT_EQ(ctx().read<float>(g.dw), twice);
  g = upload(ctx(), c, dy);
  const Tensor untouched = g.dbias;
  g.dbias = Tensor();
  conv3d_backward_weights(ctx(), g);
  EXPECT_EQ(ctx().read<float>(g.dw), once);
  EXPECT_EQ(ctx().read<float>(untouched), zeros(10));
  EXPECT_NE(bias, zeros(10));
}

TEST_P(Conv3dWeights, EmptyAddsNothing) {
  const ref::ConvCase c = make_case({{0, 3, 4}, 5, 6});
  const Conv3dBackwardWeights g = upload(ctx(), c, {});
  conv3d_backward_weights(ctx(), g);
  EXPECT_EQ(ctx().read<float>(g.dw), zeros(c.w.size()));
  EXPECT_EQ(ctx().read<float>(g.dbias), zeros(6));
}

TEST_P(Conv3dWeights, PlanTakesTheSameMemory) {
  const ref::ConvCase c = make_case({{12, 12, 16}, 13, 6});
  const std::vector<float> dy = random_floats(static_cast<std::size_t>(c.in.rows * 6), 75);
  const auto own = test::open_context(GetParam().flavour);
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) conv3d_backward_weights(*at, upload(*at, c, dy));
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(Conv3dWeights, RejectsBadShapes) {
  const ref::ConvCase c = make_case({{3, 4, 5}, 6, 7});
  const Conv3dBackwardWeights good = upload(ctx(), c, random_floats(420, 76));
  const auto rejects = [&](auto change) {
    Conv3dBackwardWeights bad = good;
    change(bad);
    EXPECT_THROW(conv3d_backward_weights(ctx(), bad), Error);
  };
  rejects([](Conv3dBackwardWeights& b) { b.dw = Tensor(); });
  rejects([](Conv3dBackwardWeights& b) { b.dy = Tensor(); });
  rejects([](Conv3dBackwardWeights& b) { b.z = 6; });
  rejects([&](Conv3dBackwardWeights& b) { b.dw = ctx().tensor({7, 5, 3, 3, 3}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dw = ctx().tensor({7, 6, 3, 3, 2}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dy = ctx().tensor({60, 6}); });
  rejects([&](Conv3dBackwardWeights& b) { b.dbias = ctx().tensor({6}); });
}

const auto kWays = ::testing::Values(Way{Flavour::cpu, ConvMethod::direct}, Way{Flavour::cpu, ConvMethod::winograd},
                                     Way{Flavour::gpu, ConvMethod::direct});
std::string way_name(const ::testing::TestParamInfo<Way>& way) {
  return std::string(name_of(way.param.flavour)) + (way.param.method == ConvMethod::winograd ? "_winograd" : "_direct");
}
INSTANTIATE_TEST_SUITE_P(Kernels, Conv3dTest, kWays, way_name);
INSTANTIATE_TEST_SUITE_P(Kernels, Conv3dWeights, kWays, way_name);

// A convolution is linear in its weights, in its biases and in its inputs: differences are derivatives, but for
// rounding in double.
TEST(Conv3dReference, GradientsAreDifferences) {
  for (const long side : {3L, 2L}) {
    ref::ConvCase c = make_case({{2, 3, 4}, 2, 3}, side);
    const std::vector<float> dy = random_floats(c.all().size(), 72);
    const auto loss = [&] {
      const std::vector<double> y = c.all();
      double sum = 0;
      for (std::size_t i = 0; i < y.size(); ++i) sum += y[i] * dy[i];
      return sum;
    };
    const auto differences = [&](std::vector<float>& by) {
      std::vector<double> out;
      for (float& v : by) {
        const float at = v;
        v = 1.0f;
        const double more = loss();
        v = -1.0f;
        out.push_back((more - loss()) / 2);
        v = at;
      }
      return out;
    };
    const ref::ConvGradient g = ref::conv_backward(c, dy);
    EXPECT_TRUE(test::close(g.dx, differences(c.in.x0), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dw, differences(c.w), 1e-12)) << side;
    EXPECT_TRUE(test::close(g.dbias, differences(c.bias), 1e-12)) << side;
  }
}

// Left to itself, the cpu flavour takes Winograd's method where there is enough to do, and the gpu flavour never.
TEST(Conv3dMethod, IsChosenBySize) {
  const std::vector<float> w(27 * 32 * 32, 1.0f);
  Context &cpu = test::context(Flavour::cpu), &gpu = test::context(Flavour::gpu);
  EXPECT_TRUE(pack_conv3d(cpu, w.data(), nullptr, 32, 32, "w").winograd);
  EXPECT_FALSE(pack_conv3d(cpu, w.data(), nullptr, 16, 32, "w").winograd);
  EXPECT_FALSE(pack_conv3d(gpu, w.data(), nullptr, 32, 32, "w").winograd);
  EXPECT_THROW(pack_conv3d(gpu, w.data(), nullptr, 32, 32, "w", ConvMethod::winograd), Error);
}

}  // namespace
}  // namespace vsplat
