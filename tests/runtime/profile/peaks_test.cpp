#include "runtime/profile/peaks.h"

#include <gtest/gtest.h>

#include "runtime/clock.h"
#include "runtime/profile/profiler.h"
#include "tests/support/device.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

// A separate cache folder for the test.
class PeaksTest : public ::testing::Test {
  const test::TemporaryFolder folder_;
  const test::Variable cache_{"VSPLAT_CACHE_DIR", folder_.path()};
};

TEST_F(PeaksTest, AreMeasuredOnceAndDated) {
  auto ctx = test::open_context(Flavour::cpu);
  EXPECT_FALSE(known_peaks(*ctx));
  const Peaks first = peaks_of(*ctx);
  EXPECT_GT(first.gflops, 0);
  EXPECT_GT(first.gbs, 0);
  EXPECT_GE(first.launch_us, 0);
  EXPECT_EQ(first.measured.size(), 10u) << first.measured;
  const auto kept = known_peaks(*ctx);
  ASSERT_TRUE(kept);
  EXPECT_EQ(kept->gflops, first.gflops);
  EXPECT_EQ(kept->measured, first.measured);
  EXPECT_EQ(peaks_of(*ctx).gbs, first.gbs);
  EXPECT_GE(peaks_of(*ctx, 2 * first.gflops).gflops, 2 * first.gflops) << "what a kernel has reached can be done";
  EXPECT_GE(known_peaks(*ctx)->gflops, 2 * first.gflops) << "and is kept";
  EXPECT_FALSE(known_peaks(*test::open_context(Flavour::gpu))) << "kernels of another flavour reach others";
}

// The measurement is not part of the profiled run.
TEST_F(PeaksTest, AreTakenOutsideTheRunsClock) {
  auto ctx = test::open_context(Flavour::cpu);
  ctx->profiler().enable(true);
  const Tensor t = ctx->tensor({1000});
  ctx->fill_zero(t);
  ctx->finish();
  const std::uint64_t start = now_ns();
  const double before = ctx->profiler().wall_seconds();
  const std::size_t peak = ctx->memory().peak();
  const std::uint64_t begun = ctx->profiler().profile().windows.front().start;
  const double measuring = peaks_of(*ctx).measuring_s;
  EXPECT_GT(measuring, 0);
  EXPECT_TRUE(ctx->profiler().enabled());
  const Profile profile = ctx->profiler().profile();
  EXPECT_EQ(profile.rows.size(), 1u);
  EXPECT_EQ(ctx->memory().peak(), peak);
  const double wall = ctx->profiler().wall_seconds(), passed = static_cast<double>(now_ns() - start) * 1e-9;
  EXPECT_LE(wall - before, passed - measuring + 1e-6);
  EXPECT_EQ(profile.windows.size(), 2u);
  EXPECT_EQ(profile.windows.front().start, begun);
}

// Little memory is enough to measure, or there are no peaks.
TEST_F(PeaksTest, LittleMemoryIsNoFault) {
  ContextOptions options;
  options.max_memory_gib = 0.02;
  auto ctx = test::open_context(Flavour::cpu, options);
  EXPECT_GT(peaks_of(*ctx).gbs, 0);
}

}  // namespace
}  // namespace vsplat
