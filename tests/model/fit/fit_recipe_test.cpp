#include "model/fit/fit_recipe.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace vsplat {
namespace {

// Step by step, as a fit grows.
double counted_mean(const FitRecipe& recipe, long from, long steps, double count) {
  const FitOptions& o = recipe.options;
  const auto most = static_cast<double>(o.max_gaussians);
  bool reduced = recipe.consolidate < 1 && from + from / 3 >= steps;
  double sum = 0;
  for (long at = from; at < steps; ++at) {
    if (!reduced && recipe.consolidate < 1 && at + at / 3 >= steps) {
      count *= recipe.consolidate;
      reduced = true;
    }
    sum += count;
    const long done = at + 1;
    if (!reduced && o.grow_every > 0 && done % o.grow_every == 0 && done < o.grow_until)
      count = std::max(std::min(o.growth * count, most), count);
  }
  return sum / static_cast<double>(steps - from);
}

TEST(FitRecipe, TheMeanNumberOfGaussiansIsThatOfTheSteps) {
  FitRequest request;
  request.steps = 2000;
  request.whole = true;
  const FitRecipe grows = fit_recipe(request, 20, {200000}, 5000);
  ASSERT_EQ(grows.options.max_gaussians, 100000);
  for (const auto& [from, count] : {std::pair(0L, 5000L), {333L, 14000L}, {1600L, 100000L}})
    EXPECT_NEAR(mean_count(grows, from, 2000, count), counted_mean(grows, from, 2000, static_cast<double>(count)), 100);
  EXPECT_GT(mean_count(grows, 0, 2000, 5000), 60000);
  request.whole = false;
  const FitRecipe halves = fit_recipe(request, 20, {2000}, 200);
  ASSERT_LT(halves.consolidate, 1);
  for (const auto& [from, count] : {std::pair(0L, 200L), {700L, 2500L}, {1700L, 1500L}})
    EXPECT_NEAR(mean_count(halves, from, 2000, count), counted_mean(halves, from, 2000, static_cast<double>(count)),
                10);
  const FitRecipe stays = fit_recipe({}, 4, {2000}, 200);
  EXPECT_EQ(mean_count(stays, 50, 200, 200), 200);
}

TEST(FitRecipe, LongFitsOfObjectsEndAtRest) {
  FitRequest request;
  for (const auto& [steps, fall] :
       {std::pair(500L, 0.1), {2000L, 0.1}, {8000L, 0.025}, {20000L, 0.01}, {30000L, 0.01}}) {
    request.steps = steps;
    const FitRecipe object = fit_recipe(request, 20, {2000}, 200);
    EXPECT_EQ(object.options.means_fall, fall) << steps;
    EXPECT_EQ(object.least_degree, 3);
  }
  request.whole = true;  // loses by it
  EXPECT_EQ(fit_recipe(request, 20, {2000}, 200).options.means_fall, 0.1);
  EXPECT_EQ(fit_recipe({}, 4, {2000}, 200).least_degree, 0);
}

// Without growth, and with a weight on opacities that leaves what no view needs transparent.
TEST(FitRecipe, FewViewsMakeFewOpaqueGaussiansOfANetworks) {
  const FitOptions few = fit_recipe({}, 11, {2000}, 200, Predicted::fitted).options,
                   many = fit_recipe({}, 12, {2000}, 200, Predicted::fitted).options;
  EXPECT_EQ(few.grow_every, 0);
  EXPECT_EQ(fit_recipe({}, 11, {2000}, 200).options.grow_every, 0);
  EXPECT_EQ(few.opacity_weight, 0);
  EXPECT_EQ(fit_recipe({}, 11, {2000}, 200).options.opacity_weight, 0);
  EXPECT_GT(fit_recipe({}, 11, {2000}, 200, Predicted::yes).options.opacity_weight, 10 * many.opacity_weight);
  EXPECT_GT(few.rates.log_scales, many.rates.log_scales);
  FitRequest request;
  request.freeze.opacities = request.freeze.scales = true;
  const FitRates frozen = fit_recipe(request, 4, {2000}, 200, Predicted::fitted).options.rates;
  EXPECT_EQ(frozen.logits, 0);
  EXPECT_EQ(frozen.log_scales, 0);
  EXPECT_EQ(frozen.quats, few.rates.quats);
}

// A cube that is ten times too large cost 0.5 dB: positions moved ten times as far in a step.
TEST(FitRecipe, LengthsFollowTheObjectWhereItsCubeIsTooLarge) {
  FitRequest request;
  const FitOptions right = fit_recipe(request, 20, {2000, 0.7}, 200).options;
  EXPECT_EQ(right.rates.means, fit_recipe(request, 20, {2000, 0.45}, 200).options.rates.means);
  const FitOptions large = fit_recipe(request, 20, {2000, 0.045}, 200).options;
  EXPECT_DOUBLE_EQ(large.rates.means, right.rates.means / 10);
  EXPECT_FLOAT_EQ(large.scale_weight, right.scale_weight * 10);
  EXPECT_GT(fit_recipe(request, 20, {2000, 0}, 200).options.rates.means, 0);
  request.whole = true;
  EXPECT_EQ(fit_recipe(request, 20, {2000, 0.05}, 200).options.rates.means,
            fit_recipe(request, 20, {2000, 0.7}, 200).options.rates.means);
}

TEST(FitRecipe, AStepGrowsWithTheGaussiansBesideThePixels) {
  EXPECT_EQ(step_growth(3000, 500, 500), 1);
  EXPECT_EQ(step_growth(3000, 500, 2000), 2);
  EXPECT_EQ(step_growth(3000, 2000, 500), 0.5);
}

}  // namespace
}  // namespace vsplat
