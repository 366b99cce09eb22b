#include "model/ops/dense/rope.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/rope.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

struct RopeSize {
  std::size_t v, h, w, prefix, heads, d;

  std::size_t tokens() const { return prefix + h * w; }
  std::size_t values() const { return v * tokens() * 3 * heads * d; }
  Shape shape() const {
    return {static_cast<long>(v), static_cast<long>(tokens()), 3, static_cast<long>(heads), static_cast<long>(d)};
  }
  std::string text() const { return fmt::format("{} x {} x {}, {} before, {} x {}", v, h, w, prefix, heads, d); }
};

const RopeSize kRopeSizes[] = {{1, 1, 1, 0, 1, 4}, {2, 3, 5, 3, 3, 8}, {1, 7, 1, 1, 2, 12}, {3, 1, 13, 5, 1, 64}};

std::vector<double> rope_angles_of(const std::vector<float>& turns) {
  std::vector<double> out;
  for (std::size_t i = 0; i < turns.size(); i += 2)
    out.push_back(std::atan2(static_cast<double>(turns[i + 1]), static_cast<double>(turns[i])));
  return out;
}

TEST(RopeTurns, AreCosineAndSineOfTheAngles) {
  for (const RopeSize& z : kRopeSizes) {
    const auto turns = rope_turns(static_cast<long>(z.h), static_cast<long>(z.w), static_cast<long>(z.d), 100, false);
    std::vector<double> want;
    for (const double a : ref::rope_angles(z.h, z.w, z.d, 100)) want.insert(want.end(), {std::cos(a), std::sin(a)});
    EXPECT_TRUE(test::close(turns, want, 1e-7)) << z.text();
  }
  // The last row's first patch of 3 x 5, by hand: y = 2/3, x = -4/5, periods 1 and 10.
  const auto got = rope_angles_of(rope_turns(3, 5, 8, 100, false));
  const double full = 2 * std::acos(-1.0);
  for (std::size_t j = 0; j < 4; ++j) {
    const double angle = full * (j < 2 ? 2.0 / 3 : -4.0 / 5) / (j % 2 == 0 ? 1 : 10);
    EXPECT_NEAR(std::remainder(got[10 * 4 + j] - angle, full), 0, 1e-6) << j;
  }
  EXPECT_THROW(rope_turns(1, 1, 6, 100, false), Error);
}

TEST(RopeTurns, PeriodsAreRoundedToBfloat16) {
  // Heads of 16: 100^(1/4), ^(1/2), ^(3/4) are 3.16228, 10, 31.6228; 8 bits leave 3.15625, 10, 31.625.
  const auto got = rope_angles_of(rope_turns(1, 4, 16, 100, true));
  const double full = 2 * std::acos(-1.0), periods[] = {1, 3.15625, 10, 31.625};
  for (std::size_t j = 0; j < 4; ++j)
    EXPECT_NEAR(std::remainder(got[3 * 8 + 4 + j] - full * 0.75 / periods[j], full), 0, 1e-6) << j;
}

class Rope : public test::FlavourTest {};
VSPLAT_FLAVOURS(Rope);
VSPLAT_OPERATION(Rope, rope)

// The reference's backward is that of differences: sum(dy f(x)) is linear in x.
TEST(RopeReference, BackIsTheGradient) {
  const RopeSize z{1, 2, 3, 1, 2, 4};
  const auto x = test::random_floats(z.values(), 1), dy = test::random_floats(z.values(), 2);
  const auto angles = ref::rope_angles(z.h, z.w, z.d, 100);
  std::vector<double> slopes;
  for (std::size_t i = 0; i < x.size(); ++i) {
    std::vector<double> unit(x.size(), 0);
    unit[i] = 1;
    const auto y = ref::rope(unit, z.v, z.tokens(), z.heads, z.d, angles, 1);
    double sum = 0;
    for (std::size_t k = 0; k < y.size(); ++k) sum += y[k] * dy[k];
    slopes.push_back(sum);
  }
  EXPECT_TRUE(test::close(ref::rope(dy, z.v, z.tokens(), z.heads, z.d, angles, -1), slopes, 1e-12));
}

TEST_P(Rope, EmptyAndBadShape) {
  rope_forward(ctx(), {ctx().tensor({0, 5, 3, 1, 4}), ctx().tensor({4, 2, 2})});
  const Tensor x = ctx().tensor({1, 5, 3, 1, 4});
  EXPECT_THROW(rope_forward(ctx(), {x, ctx().tensor({6, 2, 2})}), Error) << "more places than tokens";
  EXPECT_THROW(rope_forward(ctx(), {x, ctx().tensor({4, 1, 2})}), Error);
  EXPECT_THROW(rope_forward(ctx(), {ctx().tensor({1, 5, 3, 1, 3}), ctx().tensor({4, 1, 2})}), Error);
}

}  // namespace
}  // namespace vsplat
