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

TEST(Schedule, ExtensionsAreCosinesOfTheirOwnAndChangeNothingBeforeThem) {
  Schedule s{1e-3, 10, 100, 1.0, 0.1, 100};
  Schedule more = s;
  more.extend = {200, 50};
  EXPECT_EQ(total_steps(s), 100);
  EXPECT_EQ(total_steps(more), 350);
  for (long step = 1; step <= 100; ++step) {
    EXPECT_EQ(learning_rate(more, step), learning_rate(s, step)) << step;
    EXPECT_EQ(temperature(more, step), temperature(s, step)) << step;
  }
  const auto cosine = [](long step, long warmup, long steps) {
    return 5e-4 * (1 + std::cos(M_PI * static_cast<double>(step - warmup) / static_cast<double>(steps - warmup)));
  };
  EXPECT_DOUBLE_EQ(learning_rate(more, 101), 1e-3 / 4);  // warm-up takes a fiftieth of 200 steps
  EXPECT_DOUBLE_EQ(learning_rate(more, 104), 1e-3);
  EXPECT_DOUBLE_EQ(learning_rate(more, 202), cosine(102, 4, 200));
  EXPECT_NEAR(learning_rate(more, 300), 0, 1e-18);
  EXPECT_DOUBLE_EQ(learning_rate(more, 301), 1e-3);
  EXPECT_DOUBLE_EQ(learning_rate(more, 325), cosine(25, 1, 50));
  EXPECT_NEAR(learning_rate(more, 350), 0, 1e-18);
  EXPECT_NEAR(learning_rate(more, 360), 0, 1e-18);
  EXPECT_EQ(temperature(more, 300), 0.1);
}

TEST(Schedule, SaysWhatDoesNotComeToItsEnd) {
  EXPECT_TRUE(unfinished({}).empty()) << "the paper's";
  EXPECT_TRUE(unfinished({4e-4, 12, 600, 1, 0.1, 600}).empty());
  EXPECT_TRUE(unfinished({4e-4, 0, 20000, 0.1, 0.1, 50000}).empty()) << "a temperature that does not change";
  const auto rises = unfinished({4e-4, 600, 600, 1, 0.1, 600});
  ASSERT_EQ(rises.size(), 1u);
  EXPECT_NE(rises[0].find("rises for 600 of 600 steps"), std::string::npos) << rises[0];
  EXPECT_NE(rises[0].find("12 is usual"), std::string::npos) << rises[0];
  const auto warm = unfinished({4e-4, 400, 20000, 1, 0.1, 50000});
  ASSERT_EQ(warm.size(), 1u);
  EXPECT_NE(warm[0].find("ends at 0.64 and not at \"tau_last\", 0.1"), std::string::npos) << warm[0];
  Schedule extended{4e-4, 400, 20000, 1, 0.1, 50000};
  extended.extend = {30000};
  EXPECT_TRUE(unfinished(extended).empty());
}

TEST(Schedule, TellsExtensionsApartOnlyOnceTheyHaveBegun) {
  Schedule a{1, 0, 10, 1, 1, 0}, b = a;
  b.extend = {5};
  EXPECT_TRUE(extended_alike(a, b, 10));
  EXPECT_FALSE(extended_alike(a, b, 11));
  a.extend = {5, 7};
  EXPECT_TRUE(extended_alike(a, b, 15));
  EXPECT_FALSE(extended_alike(a, b, 16));
  a.extend = {6};
  EXPECT_TRUE(extended_alike(a, b, 10));
  EXPECT_FALSE(extended_alike(a, b, 11));
}

TEST(Schedule, RefusesStepZero) {
  EXPECT_THROW(learning_rate({}, 0), Error);
  EXPECT_THROW(temperature({}, 0), Error);
}

}  // namespace
}  // namespace vsplat
