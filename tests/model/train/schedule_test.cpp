#include "model/train/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

#include "runtime/error.h"

namespace vsplat {
namespace {

TEST(Schedule, LearningRateRisesLinearlyThenFallsAsACosine) {
  const Schedule s{4e-4, 1000, 50000};
  EXPECT_DOUBLE_EQ(learning_rate(s, 1), 4e-7);
  EXPECT_DOUBLE_EQ(learning_rate(s, 250), 1e-4);
  EXPECT_DOUBLE_EQ(learning_rate(s, 1000), 4e-4);
  EXPECT_DOUBLE_EQ(learning_rate(s, 1000 + 49000 / 3 + 1), 2e-4 * (1 + std::cos(M_PI * 16334 / 49000)));
  EXPECT_DOUBLE_EQ(learning_rate(s, 25500), 2e-4);
  EXPECT_LT(learning_rate(s, 49999), 1e-12);
  EXPECT_GT(learning_rate(s, 49999), 0);
  EXPECT_NEAR(learning_rate(s, 50000), 0, 1e-19);
  EXPECT_NEAR(learning_rate(s, 60000), 0, 1e-19);
}

TEST(Schedule, LearningRateWithoutWarmUpAndWithNothingElse) {
  const Schedule none{1, 0, 4}, all{1, 4, 4};
  EXPECT_DOUBLE_EQ(learning_rate(none, 1), 0.5 * (1 + std::cos(M_PI / 4)));
  EXPECT_NEAR(learning_rate(none, 4), 0, 1e-15);
  EXPECT_DOUBLE_EQ(learning_rate(all, 3), 0.75);
  EXPECT_DOUBLE_EQ(learning_rate(all, 4), 1);
  EXPECT_NEAR(learning_rate(all, 5), 0, 1e-15);
}

TEST(Schedule, TemperatureFallsLinearlyAndStays) {
  const Schedule s{4e-4, 1000, 90000, 1.0, 0.1, 50000};
  EXPECT_EQ(temperature(s, 1), 1.0);
  EXPECT_DOUBLE_EQ(temperature(s, 2), 1 - 0.9 / 50000);
  EXPECT_DOUBLE_EQ(temperature(s, 25001), 0.55);
  EXPECT_EQ(temperature(s, 50001), 0.1);
  EXPECT_EQ(temperature(s, 90000), 0.1);
}

TEST(Schedule, TemperatureWithoutAnnealing) {
  const Schedule s{4e-4, 1000, 90000, 1.0, 0.1, 0};
  EXPECT_EQ(temperature(s, 1), 0.1);
}

TEST(Schedule, RefusesStepZero) {
  EXPECT_THROW(learning_rate({}, 0), Error);
  EXPECT_THROW(temperature({}, 0), Error);
}

}  // namespace
}  // namespace vsplat
