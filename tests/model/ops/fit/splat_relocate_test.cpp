#include "model/ops/fit/splat_relocate.h"

#include <algorithm>
#include <numeric>

#include "model/diagnose/selftest/inputs/fit_states.h"
#include "model/diagnose/selftest/reference/splat_relocate.h"
#include "model/render/render.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using selftest::FitRows;
using selftest::FitState;
using selftest::logit;
using selftest::sigmoid;

constexpr float kGone = -20;  // the logit of a Gaussian that is relocated

class SplatRelocateOp : public test::FlavourTest {
 protected:
  static FitState state_of(const std::vector<float>& logits, std::size_t capacity, std::size_t s = 4) {
    const auto rows = [&](std::uint32_t seed) { return selftest::fit_rows(logits.size(), capacity, seed, s); };
    FitState out{rows(1), rows(11), rows(21)};
    std::copy(logits.begin(), logits.end(), out.x.logits.begin());
    return out;
  }

  SplatParameters upload(const FitRows& r) { return selftest::up_rows(ctx(), r); }
  FitRows read(const SplatParameters& x) { return selftest::read_rows(ctx(), x); }

  // Relocates the Gaussians of `state` in place. Returns their number.
  long relocate(FitState& state, long count, long grow_to, std::uint64_t seed = 3, std::uint32_t draw = 5) {
    const SplatRelocate a{{upload(state.x), upload(state.m), upload(state.v)}, count, grow_to, seed, draw};
    const long got = splat_relocate(ctx(), a);
    state = {read(a.all.x), read(a.all.m), read(a.all.v)};
    return got;
  }
};
VSPLAT_FLAVOURS(SplatRelocateOp);
VSPLAT_OPERATION(SplatRelocateOp, splat_relocate)

// One source and n - 1 that join it: the new opacity and the new scales, over all that they can be.
TEST_P(SplatRelocateOp, SharesAgreeWithTheFormula) {
  double worst_opacity = 0, worst_scale = 0;
  for (const std::size_t n : {2U, 3U, 4U, 5U, 7U, 12U, 16U, 17U, 20U, 33U, 50U, 51U, 52U, 64U, 200U})
    for (const double opacity : {0.0051, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 0.995, 0.999, 0.9999}) {
      const std::size_t source = n / 2;
      std::vector<float> logits(n, kGone);
      logits[source] = logit(opacity);
      const FitState before = state_of(logits, n, 1);
      FitState after = before;
      const auto count = static_cast<long>(n);
      ASSERT_EQ(relocate(after, count, count), count);
      const auto equal = static_cast<int>(n);
      const double was = sigmoid(logits[source]), scale = ref::shared_scale(was, equal);
      const double each = std::max(ref::shared_opacity(was, equal), 0.005);
      for (std::size_t k = 0; k < n; ++k) {
        worst_opacity = std::max(worst_opacity, std::abs(sigmoid(after.x.logits[k]) / each - 1));
        for (std::size_t i = 0; i < 3; ++i) {
          const double longer =
              std::exp(static_cast<double>(after.x.log_scales[3 * k + i]) - before.x.log_scales[3 * source + i]);
          worst_scale = std::max(worst_scale, std::abs(longer / scale - 1));
        }
      }
    }
  // At 0.9999, of which float32 rounds what is missing to 1 by 3e-4.
  EXPECT_LT(worst_opacity, 3e-5);
  EXPECT_LT(worst_scale, 5e-6);
}

// Without any that moves and without growth, and where none is opaque enough to be joined, growth or not.
TEST_P(SplatRelocateOp, ChangesNothingWhereThereIsNothingToDo) {
  const FitState all_seen = state_of({1, 0, -1, 2}, 6), none_seen = state_of({-9, -20, -6, -7}, 6);
  FitState after = all_seen;
  EXPECT_EQ(relocate(after, 4, 4), 4);
  EXPECT_TRUE(after == all_seen);
  for (const long grow_to : {4L, 6L}) {
    after = none_seen;
    EXPECT_EQ(relocate(after, 4, grow_to), 4);
    EXPECT_TRUE(after == none_seen) << grow_to;
  }
  after = all_seen;
  EXPECT_EQ(relocate(after, 0, 0), 0);
  EXPECT_EQ(relocate(after, 0, 3), 0);
  EXPECT_TRUE(after == all_seen);
}

// For one wide Gaussian: alpha at its centre, and the sum along a line through it, which equation 9 preserves (except
// for the tails below 1/255, which are not drawn).
TEST_P(SplatRelocateOp, NEqualOnesLookAsOneDid) {
  const test::SceneCase c{"", 1, 0, 65, 65, ""};
  const Camera camera = test::make_camera(c, 3);
  const auto alpha_of = [&](const FitRows& r) {
    Gaussians g;
    g.count = r.logits.size();
    g.means = r.means, g.quats = r.quats, g.sh = r.sh;
    for (const float x : r.log_scales) g.scales.push_back(std::exp(x));
    for (const float x : r.logits) g.opacities.push_back(static_cast<float>(sigmoid(x)));
    return render_picture(ctx(), vsplat::upload(ctx(), g), camera, {}).alpha.data;
  };
  struct Seen {
    double most = 0, line = 0;
  };
  const auto seen = [&](const FitRows& r) {
    const auto alpha = alpha_of(r);
    const auto top = std::max_element(alpha.begin(), alpha.end());
    const auto row = alpha.begin() + (top - alpha.begin()) / 65 * 65;
    return Seen{*top, std::accumulate(row, row + 65, 0.0)};
  };
  for (const auto& [opacity, n] : {std::pair{0.3, 2}, {0.5, 3}, {0.8, 2}, {0.8, 5}, {0.95, 4}, {0.9, 12}}) {
    const FitRows one{{0.02f, -0.01f, 0.03f},
                      {-1.8f, -1.6f, -2.0f},
                      {0.8f, 0.3f, -0.4f, 0.2f},
                      {logit(opacity)},
                      {0.5f, 0.1f, -0.2f}};
    FitState state = state_of({logit(opacity)}, static_cast<std::size_t>(n), 1);
    for (const auto kind : selftest::kFitKinds)
      std::copy((one.*kind).begin(), (one.*kind).end(), (state.x.*kind).begin());
    ASSERT_EQ(relocate(state, 1, n), n);
    const Seen before = seen(one), after = seen(state.x);
    for (std::size_t i = 0; i < state.x.log_scales.size(); ++i) state.x.log_scales[i] = one.log_scales[i % 3];
    const Seen wide = seen(state.x);
    EXPECT_GT(before.most, 0.95 * opacity);
    EXPECT_NEAR(after.most, before.most, 0.005);
    EXPECT_NEAR(after.line, before.line, 0.01 * before.line);
    EXPECT_GT(wide.line, 1.02 * before.line) << "with the opacity alone";
  }
}

TEST_P(SplatRelocateOp, OtherSourcesInAnotherDraw) {
  const FitState before = state_of(test::random_floats(1009, 6, -8, 4), 1200);
  FitState first = before, draw = before, seed = before;
  relocate(first, 1009, 1100);
  relocate(draw, 1009, 1100, 3, 6), relocate(seed, 1009, 1100, 4, 5);
  EXPECT_FALSE(first == draw);
  EXPECT_FALSE(first == seed);
}

TEST_P(SplatRelocateOp, RejectsWhatDoesNotFit) {
  FitState state = state_of({1, 2, 3}, 5);
  EXPECT_THROW(relocate(state, 3, 2), Error);
  EXPECT_THROW(relocate(state, 3, 6), Error);
  EXPECT_THROW(relocate(state, -1, 3), Error);
}

// The moves of Gaussians at the origin.
class SplatNoiseOp : public SplatRelocateOp {
 protected:
  std::vector<float> moves(const FitRows& x, float rate, std::uint64_t seed = 3, std::uint32_t draw = 5) {
    const SplatNoise a{upload(x), rate, seed, draw};
    splat_noise(ctx(), a);
    const FitRows after = read(a.x);
    FitRows rest = after;
    rest.means = x.means;
    EXPECT_TRUE(rest == x) << "only means move";
    return after.means;
  }

  static FitRows at_origin(const std::vector<float>& logits) {
    FitRows x = state_of(logits, logits.size(), 1).x;
    x.means.assign(x.means.size(), 0.0f);
    x.quats = test::random_floats(x.quats.size(), 9, -2, 2);  // of any length
    return x;
  }
};
VSPLAT_FLAVOURS(SplatNoiseOp);

// Many that are alike: their moves have no mean, and the covariance (rate sigm)^2 C^2; they know nothing of each other.
TEST_P(SplatNoiseOp, MovesAreNormalWithTheSquaredCovariance) {
  constexpr std::size_t count = 40000;
  FitRows x = at_origin(std::vector<float>(count, -8.0f));
  const float log_scale[] = {-1.0f, -2.0f, -2.5f}, quat[] = {0.9f, -0.4f, 0.3f, 0.6f};
  for (std::size_t i = 0; i < 3 * count; ++i) x.log_scales[i] = log_scale[i % 3];
  for (std::size_t i = 0; i < 4 * count; ++i) x.quats[i] = quat[i % 4];
  const auto got = moves(x, 2);
  const auto c = ref::covariance({-1, -2, -2.5}, {0.9, -0.4, 0.3, 0.6});
  const double by = 2 * ref::wandering(sigmoid(-8));
  for (std::size_t i = 0; i < 3; ++i) {
    double mean = 0, deviation = 0;
    for (std::size_t k = 0; k < 3; ++k) deviation += by * by * c[i][k] * c[k][i];
    deviation = std::sqrt(deviation);
    for (std::size_t g = 0; g < count; ++g) mean += got[3 * g + i] / static_cast<double>(count);
    EXPECT_LT(std::abs(mean), 5 * deviation / std::sqrt(static_cast<double>(count)));
    double fourth = 0, neighbours = 0;
    for (std::size_t g = 0; g < count; ++g) fourth += std::pow(got[3 * g + i] / deviation, 4) / count;
    for (std::size_t g = 1; g < count; ++g)
      neighbours += got[3 * g + i] / deviation * (got[3 * g - 3 + i] / deviation) / count;
    EXPECT_NEAR(fourth, 3, 0.25);  // sqrt(96 / count) = 0.05 is one standard deviation
    EXPECT_NEAR(neighbours, 0, 0.025);
    for (std::size_t j = 0; j < 3; ++j) {
      double want = 0, of_i = 0, of_j = 0, sum = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        want += by * by * c[i][k] * c[k][j];
        of_i += by * by * c[i][k] * c[k][i], of_j += by * by * c[j][k] * c[k][j];
      }
      for (std::size_t g = 0; g < count; ++g) sum += static_cast<double>(got[3 * g + i]) * got[3 * g + j] / count;
      // At most sqrt(2 / count) of the product of both deviations is one standard deviation.
      EXPECT_NEAR(sum, want, 5 * std::sqrt(2.0 / count) * std::sqrt(of_i * of_j)) << i << " " << j;
    }
  }
}

TEST_P(SplatNoiseOp, WhatIsSeenStays) {
  const FitRows x = at_origin({logit(0.15), 0, 8, logit(0.3), -3});
  const auto got = moves(x, 1e3f);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(got[i], 0.0f) << i;
  EXPECT_NE(got[12], 0.0f);
  EXPECT_EQ(moves(x, 0), x.means);
}

TEST_P(SplatNoiseOp, OtherMovesInAnotherDraw) {
  const FitRows x = at_origin(test::random_floats(200, 8, -8, -6));
  const auto first = moves(x, 1);
  EXPECT_NE(moves(x, 1, 3, 6), first);
  EXPECT_NE(moves(x, 1, 4, 5), first);
  EXPECT_NE(moves(x, 1, 3 + (std::uint64_t{1} << 32), 5), first);
}

}  // namespace
}  // namespace vsplat
