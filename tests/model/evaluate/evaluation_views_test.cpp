#include "model/evaluate/evaluation_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "runtime/error.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using Positions = std::vector<Eigen::Vector3d>;

Eigen::Vector3d at(double degrees, double distance = 2) {
  const double a = degrees * 3.14159265358979 / 180;
  return {distance * std::cos(a), distance * std::sin(a), 0};
}

// Four clusters of three, interleaved: 0 4 8, 1 5 9, 2 6 10, 3 7 11.
Positions clusters() {
  Positions out;
  for (const double shift : {0.0, 9.0, 4.0})
    for (const double middle : {10.0, 100.0, 190.0, 280.0}) out.push_back(at(middle + shift));
  return out;
}

TEST(EvaluationViews, AreTheFirstAndTheLastOfEachGroup) {
  const EvaluationViews views = evaluation_views(clusters(), 4, Protocol::kmeans, 0, "cup");
  EXPECT_EQ(views.inputs, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(views.novel, (std::vector<int>{8, 9, 10, 11}));
}

TEST(EvaluationViews, NovelViewsComeFromFourGroupsWhateverTheInputs) {
  const EvaluationViews one = evaluation_views(clusters(), 1, Protocol::kmeans, 0, "cup");
  EXPECT_EQ(one.inputs, (std::vector<int>{0}));
  EXPECT_EQ(one.novel, (std::vector<int>{8, 9, 10, 11}));
  // Twelve groups of one: the novel view would be an input.
  EXPECT_THROW(evaluation_views(clusters(), 12, Protocol::kmeans, 0, "cup"), Error);
}

TEST(EvaluationViews, ASingleViewOfAGroupIsAnInputAlone) {
  Positions positions = clusters();
  positions.resize(6);  // 0 4, 1 5, 2, 3
  const EvaluationViews views = evaluation_views(positions, 4, Protocol::kmeans, 0, "cup");
  EXPECT_EQ(views.inputs, (std::vector<int>{0, 1, 2, 3}));
  EXPECT_EQ(views.novel, (std::vector<int>{4, 5}));
  positions.resize(4);
  EXPECT_EQ(test::refusal([&] { evaluation_views(positions, 4, Protocol::kmeans, 0, "cup"); }, Status::input),
            "object cup: 4 views, all of which are inputs: none is left to compare with");
}

TEST(EvaluationViews, RandomOnesAreTenOthers) {
  Positions positions;
  for (int i = 0; i < 40; ++i) positions.push_back(at(9 * i));
  const EvaluationViews views = evaluation_views(positions, 4, Protocol::random10, 1, "cup");
  EXPECT_EQ(views.inputs, evaluation_views(positions, 4, Protocol::kmeans, 0, "cup").inputs);
  EXPECT_EQ(views.novel.size(), 10u);
  EXPECT_TRUE(std::is_sorted(views.novel.begin(), views.novel.end()));
  std::set<int> all(views.inputs.begin(), views.inputs.end());
  for (const int view : views.novel) {
    EXPECT_TRUE(view >= 0 && view < 40);
    EXPECT_TRUE(all.insert(view).second) << view;
  }
  EXPECT_EQ(evaluation_views(positions, 4, Protocol::random10, 1, "cup").novel, views.novel);
  EXPECT_NE(evaluation_views(positions, 4, Protocol::random10, 2, "cup").novel, views.novel);
  EXPECT_NE(evaluation_views(positions, 4, Protocol::random10, 1, "mug").novel, views.novel);
  // Every view is used.
  std::set<int> seen;
  for (std::uint64_t seed = 0; seed < 60; ++seed)
    for (const int view : evaluation_views(positions, 4, Protocol::random10, seed, "cup").novel) seen.insert(view);
  EXPECT_EQ(seen.size(), 36u);
  positions.resize(12);
  EXPECT_EQ(evaluation_views(positions, 4, Protocol::random10, 1, "cup").novel.size(), 8u);
}

TEST(EvaluationViews, NearestIsByAngleFromTheCentre) {
  const Eigen::Vector3d centre(5, 0, 1);
  const Positions positions = {centre + at(0, 9), centre + at(60, 1), centre + at(170, 0.5), centre + at(60, 4)};
  const std::vector<int> views = {0, 2, 3};
  EXPECT_EQ(nearest_view(positions, views, centre + at(29, 0.1), centre), 0);
  EXPECT_EQ(nearest_view(positions, views, centre + at(31, 50), centre), 3);
  EXPECT_EQ(nearest_view(positions, views, centre + at(150, 9), centre), 2);
  EXPECT_EQ(nearest_view(positions, std::vector<int>{1, 3}, centre + at(50), centre), 1);  // equal: the first
  EXPECT_EQ(nearest_view(positions, views, centre, centre), 0);  // no direction: none is nearer
}

}  // namespace
}  // namespace vsplat
