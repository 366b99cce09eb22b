#include "model/ops/fit/splat_relocate.h"

#include <algorithm>
#include <map>
#include <numeric>

#include "model/diagnose/selftest/reference/splat_relocate.h"
#include "model/render/render.h"
#include "runtime/fail.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }
float logit(double p) { return static_cast<float>(std::log(p / (1 - p))); }

constexpr float kUnused = 7;  // fills the unused rows of the capacity
constexpr float kGone = -20;  // the logit of a Gaussian that is relocated
constexpr double kLeast = 0.005;
constexpr double kMost = 1.0f - 1e-6f;

// Parameters, or their moments, on the host.
struct Rows {
  std::vector<float> means, log_scales, quats, logits, sh;
};
struct State {
  Rows x, m, v;
};
constexpr std::vector<float> Rows::*kKinds[] = {&Rows::means, &Rows::log_scales, &Rows::quats, &Rows::logits,
                                                &Rows::sh};

bool operator==(const Rows& a, const Rows& b) {
  return std::all_of(std::begin(kKinds), std::end(kKinds), [&](auto kind) { return a.*kind == b.*kind; });
}
bool operator==(const State& a, const State& b) { return a.x == b.x && a.m == b.m && a.v == b.v; }

class SplatRelocateOp : public test::FlavourTest {
 protected:
  // A state with the given logits and space for `capacity` Gaussians. The first coordinate of each mean is the
  // Gaussian's index, which identifies its copies.
  static State state_of(const std::vector<float>& logits, std::size_t capacity, std::size_t s = 4) {
    const auto rows = [&](std::uint32_t seed) {
      const auto random = [&](std::size_t each) {
        auto out = test::random_floats(each * logits.size(), seed++, -3, -1);
        out.resize(each * capacity, kUnused);
        return out;
      };
      return Rows{random(3), random(3), random(4), random(1), random(3 * s)};
    };
    State out{rows(1), rows(11), rows(21)};
    std::copy(logits.begin(), logits.end(), out.x.logits.begin());
    for (std::size_t k = 0; k < logits.size(); ++k) out.x.means[3 * k] = static_cast<float>(k);
    return out;
  }

  SplatParameters upload(const Rows& r) {
    const auto n = static_cast<long>(r.logits.size()), s = n > 0 ? static_cast<long>(r.sh.size()) / (3 * n) : 1;
    return {ctx().upload({n, 3}, r.means), ctx().upload({n, 3}, r.log_scales), ctx().upload({n, 4}, r.quats),
            ctx().upload({n}, r.logits), ctx().upload({n, s, 3}, r.sh)};
  }
  Rows read(const SplatParameters& x) {
    return {ctx().read<float>(x.means), ctx().read<float>(x.log_scales), ctx().read<float>(x.quats),
            ctx().read<float>(x.logits), ctx().read<float>(x.sh)};
  }

  // Relocates the Gaussians of `state` in place. Returns their number.
  long relocate(State& state, long count, long grow_to, std::uint64_t seed = 3, std::uint32_t draw = 5) {
    const SplatRelocate a{{upload(state.x), upload(state.m), upload(state.v)}, count, grow_to, seed, draw};
    const long got = splat_relocate(ctx(), a);
    state = {read(a.all.x), read(a.all.m), read(a.all.v)};
    return got;
  }

  // The source of each point as the result shows it: points go to those that move, in their order, then behind the
  // last.
  static std::vector<std::size_t> sources(const State& before, const State& after, std::size_t count,
                                          std::size_t grow_to) {
    std::vector<std::size_t> out;
    for (std::size_t k = 0; k < grow_to; ++k)
      if (k >= count || !(sigmoid(before.x.logits[k]) >= kLeast))
        out.push_back(static_cast<std::size_t>(after.x.means[3 * k]));
    return out;
  }

  // That each Gaussian is what its source and the number of those that share it say, and all the others are as they
  // were.
  void check_shares(const State& before, const State& after, std::size_t count, std::size_t grow_to) {
    const auto from = sources(before, after, count, grow_to);
    std::map<std::size_t, int> taken;
    for (const std::size_t k : from) ++taken[k];
    const std::size_t capacity = before.x.logits.size(), s3 = before.x.sh.size() / capacity;
    std::size_t point = 0;
    State want = before;
    std::vector<double> logits(before.x.logits.begin(), before.x.logits.end());
    std::vector<double> log_scales(before.x.log_scales.begin(), before.x.log_scales.end());
    for (std::size_t k = 0; k < grow_to; ++k) {
      const bool moves = k >= count || !(sigmoid(before.x.logits[k]) >= kLeast);
      const std::size_t source = moves ? from[point++] : k;
      ASSERT_LT(source, count);
      if (taken.count(source) == 0) continue;
      const double opacity = std::min(sigmoid(before.x.logits[source]), kMost);
      const int n = taken[source] + 1;
      const double each = std::max(ref::shared_opacity(opacity, n), kLeast);
      logits[k] = std::log(each / (1 - each));
      const double longer = std::log(ref::shared_scale(opacity, n));
      want.m.logits[k] = want.v.logits[k] = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        log_scales[3 * k + i] = before.x.log_scales[3 * source + i] + longer;
        want.m.log_scales[3 * k + i] = want.v.log_scales[3 * k + i] = 0;
      }
      if (!moves) continue;
      const auto copied = [&](std::vector<float> Rows::*kind, std::size_t each_row) {
        for (std::size_t i = 0; i < each_row; ++i) {
          (want.x.*kind)[each_row * k + i] = (before.x.*kind)[each_row * source + i];
          (want.m.*kind)[each_row * k + i] = (want.v.*kind)[each_row * k + i] = 0;
        }
      };
      copied(&Rows::means, 3), copied(&Rows::quats, 4), copied(&Rows::sh, s3);
    }
    // The rounding of an opacity near 1 is much of what is missing to 1.
    EXPECT_TRUE(test::close(after.x.logits, logits, 1e-5));
    EXPECT_TRUE(test::close(after.x.log_scales, log_scales, 1e-6));
    want.x.logits = after.x.logits, want.x.log_scales = after.x.log_scales;
    EXPECT_TRUE(after == want) << "what is copied, kept or set to zeros";
  }
};
VSPLAT_FLAVOURS(SplatRelocateOp);
VSPLAT_OPERATION(SplatRelocateOp, splat_relocate)

// One source and n - 1 that join it: the new opacity and the new scales, over all that they can be.
TEST_P(SplatRelocateOp, SharesAgreeWithTheFormula) {
  double worst_opacity = 0, worst_scale = 0;
  for (const std::size_t n : {2U, 3U, 4U, 5U, 7U, 12U, 20U, 33U, 50U, 51U, 52U, 64U, 200U})
    for (const double opacity : {0.0051, 0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97, 0.99, 0.995, 0.999, 0.9999}) {
      const std::size_t source = n / 2;
      std::vector<float> logits(n, kGone);
      logits[source] = logit(opacity);
      const State before = state_of(logits, n, 1);
      State after = before;
      const auto count = static_cast<long>(n);
      ASSERT_EQ(relocate(after, count, count), count);
      const auto equal = static_cast<int>(n);
      const double was = sigmoid(logits[source]), scale = ref::shared_scale(was, equal);
      const double each = std::max(ref::shared_opacity(was, equal), kLeast);
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

// Weights that float32 cannot round: opacities of 1/2 and 1. Each point's source is the one that it has in a walk over
// all points, at sizes that break things.
TEST_P(SplatRelocateOp, SourcesAreThoseOfSystematicResampling) {
  for (const std::size_t count : {1U, 3U, 7U, 63U, 64U, 65U, 1009U, 100003U})
    for (const double growth : {1.0, 1.3, 2.9}) {
      SCOPED_TRACE(::testing::Message() << count << " Gaussians, growth " << growth);
      const auto random = test::random_floats(count, static_cast<std::uint32_t>(count), 0, 1);
      std::vector<float> logits;
      logits.reserve(count);
      for (const float r : random) logits.push_back(r < 0.3f ? kGone : r < 0.7f ? 0.0f : 20.0f);
      logits[count / 2] = 0;
      const auto grow_to = static_cast<std::size_t>(growth * static_cast<double>(count));
      const State before = state_of(logits, grow_to + 2);
      State after = before;
      ASSERT_EQ(relocate(after, static_cast<long>(count), static_cast<long>(grow_to)), static_cast<long>(grow_to));
      const double finest = std::floor(std::min(4294967040.0 / static_cast<double>(count) - 1, 65535.0));
      std::vector<std::uint32_t> weights;
      std::uint64_t total = 0;
      for (const float x : logits) {
        weights.push_back(x < 0 ? 0 : static_cast<std::uint32_t>((x > 0 ? 1 : 0.5) * finest) + 1);
        total += weights.back();
      }
      const auto moving = static_cast<std::size_t>(std::count(logits.begin(), logits.end(), kGone));
      const std::uint64_t points = moving + grow_to - count;
      const auto got = sources(before, after, count, grow_to);
      if (points > 0) {
        EXPECT_EQ(got, ref::systematic_sources(weights, points, ref::systematic_offset(3, 5, total)));
      }
      check_shares(before, after, count, grow_to);
    }
}

// A point on the border of two belongs to the second. (The draw is one of those that begin at 0.)
TEST_P(SplatRelocateOp, PointsOnABorderAreTakenOnce) {
  std::uint32_t draw = 0;
  while (ref::systematic_offset(3, draw, 65536) != 0) ++draw;
  const State before = state_of({0, 0}, 4);
  State after = before;
  EXPECT_EQ(relocate(after, 2, 4, 3, draw), 4);
  EXPECT_EQ(sources(before, after, 2, 4), (std::vector<std::size_t>{0, 1}));
  check_shares(before, after, 2, 4);
}

// Any opacities: each source has as many points as its share of them, up to one, and none that moves has any.
TEST_P(SplatRelocateOp, SourcesAreDrawnInProportionToTheirOpacity) {
  for (const std::size_t count : {1000U, 100003U})
    for (const bool moving : {false, true}) {
      auto logits = test::random_floats(count, 5, moving ? -9.0f : -4.0f, 4);
      for (float& x : logits)
        if (std::abs(sigmoid(x) - kLeast) < 1e-6) x += 0.01f;
      const std::size_t grow_to = count + count / 3;
      const State before = state_of(logits, grow_to, 1);
      State after = before;
      ASSERT_EQ(relocate(after, static_cast<long>(count), static_cast<long>(grow_to)), static_cast<long>(grow_to));
      const auto got = sources(before, after, count, grow_to);
      EXPECT_TRUE(std::is_sorted(got.begin(), got.end()));
      EXPECT_EQ(got.size() > grow_to - count, moving);
      std::vector<int> taken(count);
      for (const std::size_t k : got) ++taken[k];
      double sum = 0;
      for (const float x : logits) sum += sigmoid(x) >= kLeast ? sigmoid(x) : 0;
      for (std::size_t k = 0; k < count; ++k) {
        const double share = sigmoid(logits[k]) >= kLeast ? sigmoid(logits[k]) / sum : 0;
        // One, and what the weights' rounding moves.
        ASSERT_LE(std::abs(taken[k] - share * static_cast<double>(got.size())), share > 0 ? 1.01 : 0) << k;
      }
      check_shares(before, after, count, grow_to);
    }
}

TEST_P(SplatRelocateOp, TakesSphericalHarmonicsOfEveryDegree) {
  for (const std::size_t s : {1U, 4U, 9U, 16U}) {
    const State before = state_of({1, kGone, -1, kGone, 0.5f}, 9, s);
    State after = before;
    EXPECT_EQ(relocate(after, 5, 8), 8);
    check_shares(before, after, 5, 8);
  }
}

TEST_P(SplatRelocateOp, AllButOneMove) {
  std::vector<float> logits(300, kGone);
  logits[123] = 3;
  const State before = state_of(logits, 310);
  State after = before;
  EXPECT_EQ(relocate(after, 300, 305), 305);
  EXPECT_EQ(sources(before, after, 300, 305), std::vector<std::size_t>(304, 123));
  check_shares(before, after, 300, 305);
}

// What is nearly transparent by less than it takes stays; logits of the fit's limits, and one that is no number.
TEST_P(SplatRelocateOp, MovesWhatIsBelowTheLeastOpacity) {
  const State before = state_of({8, logit(0.00501), logit(0.00499), -12, -200, 8}, 6);
  State after = before;
  EXPECT_EQ(relocate(after, 6, 6), 6);
  const auto from = sources(before, after, 6, 6);
  ASSERT_EQ(from.size(), 3U);
  for (const std::size_t k : from) EXPECT_TRUE(k == 0 || k == 5) << k;
  check_shares(before, after, 6, 6);
}

// Without any that moves and without growth, and where none is opaque enough to be joined, growth or not.
TEST_P(SplatRelocateOp, ChangesNothingWhereThereIsNothingToDo) {
  const State all_seen = state_of({1, 0, -1, 2}, 6), none_seen = state_of({-9, -20, -6, -7}, 6);
  State after = all_seen;
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
  const auto alpha_of = [&](const Rows& r) {
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
  const auto seen = [&](const Rows& r) {
    const auto alpha = alpha_of(r);
    const auto top = std::max_element(alpha.begin(), alpha.end());
    const auto row = alpha.begin() + (top - alpha.begin()) / 65 * 65;
    return Seen{*top, std::accumulate(row, row + 65, 0.0)};
  };
  for (const auto& [opacity, n] : {std::pair{0.3, 2}, {0.5, 3}, {0.8, 2}, {0.8, 5}, {0.95, 4}, {0.9, 12}}) {
    const Rows one{{0.02f, -0.01f, 0.03f},
                   {-1.8f, -1.6f, -2.0f},
                   {0.8f, 0.3f, -0.4f, 0.2f},
                   {logit(opacity)},
                   {0.5f, 0.1f, -0.2f}};
    State state = state_of({logit(opacity)}, static_cast<std::size_t>(n), 1);
    for (const auto kind : kKinds) std::copy((one.*kind).begin(), (one.*kind).end(), (state.x.*kind).begin());
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

TEST_P(SplatRelocateOp, SameBitsAgainAndOthersInAnotherDraw) {
  const State before = state_of(test::random_floats(1009, 6, -8, 4), 1200);
  State first = before, again = before, draw = before, seed = before;
  relocate(first, 1009, 1100), relocate(again, 1009, 1100);
  EXPECT_TRUE(first == again);
  relocate(draw, 1009, 1100, 3, 6), relocate(seed, 1009, 1100, 4, 5);
  EXPECT_FALSE(first == draw);
  EXPECT_FALSE(first == seed);
}

TEST_P(SplatRelocateOp, RejectsWhatDoesNotFit) {
  State state = state_of({1, 2, 3}, 5);
  EXPECT_THROW(relocate(state, 3, 2), Error);
  EXPECT_THROW(relocate(state, 3, 6), Error);
  EXPECT_THROW(relocate(state, -1, 3), Error);
}

// The moves of Gaussians at the origin.
class SplatNoiseOp : public SplatRelocateOp {
 protected:
  std::vector<float> moves(const Rows& x, float rate, std::uint64_t seed = 3, std::uint32_t draw = 5) {
    const SplatNoise a{upload(x), rate, seed, draw};
    splat_noise(ctx(), a);
    const Rows after = read(a.x);
    Rows rest = after;
    rest.means = x.means;
    EXPECT_TRUE(rest == x) << "only means move";
    return after.means;
  }

  static Rows at_origin(const std::vector<float>& logits) {
    Rows x = state_of(logits, logits.size(), 1).x;
    x.means.assign(x.means.size(), 0.0f);
    x.quats = test::random_floats(x.quats.size(), 9, -2, 2);  // of any length
    return x;
  }
};
VSPLAT_FLAVOURS(SplatNoiseOp);

// Many that are alike: their moves have no mean, and the covariance (rate sigm)^2 C^2; they know nothing of each other.
TEST_P(SplatNoiseOp, MovesAreNormalWithTheSquaredCovariance) {
  constexpr std::size_t count = 40000;
  Rows x = at_origin(std::vector<float>(count, -8.0f));
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
  const Rows x = at_origin({logit(0.15), 0, 8, logit(0.3), -3});
  const auto got = moves(x, 1e3f);
  for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(got[i], 0.0f) << i;
  EXPECT_NE(got[12], 0.0f);
  EXPECT_EQ(moves(x, 0), x.means);
}

TEST_P(SplatNoiseOp, SameBitsAgainAndOthersInAnotherDraw) {
  const Rows x = at_origin(test::random_floats(200, 8, -8, -6));
  const auto first = moves(x, 1);
  EXPECT_EQ(moves(x, 1), first);
  EXPECT_NE(moves(x, 1, 3, 6), first);
  EXPECT_NE(moves(x, 1, 4, 5), first);
  EXPECT_NE(moves(x, 1, 3 + (std::uint64_t{1} << 32), 5), first);
}

}  // namespace
}  // namespace vsplat
