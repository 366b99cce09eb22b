#include "model/views/view_choice.h"

#include <fmt/format.h>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using test::expect_error;
using Indices = std::vector<int>;

TEST(Kmeans, FollowsTheProtocol) {
  // Two far clusters and one between, out of order. Starts: 0, the farthest (3), and the farthest from both (2).
  const std::vector<Vector3d> p = {{0, 0, 0}, {10, 0, 0}, {5, 1, 0}, {11, 0, 0}, {0, 1, 0}, {0.5, 0.5, 0}, {5, -1, 0}};
  const std::vector<Group> groups = kmeans(p, 3);
  ASSERT_EQ(groups.size(), 3U);
  EXPECT_EQ(groups[0].members, (Indices{0, 4, 5}));
  EXPECT_EQ(groups[1].members, (Indices{1, 3}));
  EXPECT_EQ(groups[2].members, (Indices{2, 6}));
  EXPECT_LT((groups[0].mean - Vector3d(0.5 / 3, 0.5, 0)).norm(), 1e-15);
  EXPECT_EQ(nearest_members(p, groups), (Indices{5, 1, 2}));  // ties go to the lower index
}

TEST(Kmeans, TiesGoToTheLowerIndex) {
  // 1 and 2 are equally far from 0, so 1 is the second start. 3 is equally far from both starts and joins the first
  // group.
  const std::vector<Vector3d> p = {{0, 0, 0}, {4, 0, 0}, {-4, 0, 0}, {2, 0, 0}};
  const std::vector<Group> groups = kmeans(p, 2);
  ASSERT_EQ(groups.size(), 2U);
  EXPECT_EQ(groups[0].members, (Indices{0, 2}));
  EXPECT_EQ(groups[1].members, (Indices{1, 3}));
}

TEST(Kmeans,
     IsOfLeastMovement) {  // each member is nearest to its own group's mean, and each mean is that of its members
  std::vector<Vector3d> p;
  unsigned random = 7;
  for (int i = 0; i < 200; ++i) {
    Vector3d v;
    for (int k = 0; k < 3; ++k) random = random * 1664525U + 1013904223U, v[k] = (random >> 8) / 16777216.0;
    p.push_back(v);
  }
  for (const int k : {1, 4, 16}) {
    const std::vector<Group> groups = kmeans(p, k);
    ASSERT_EQ(groups.size(), static_cast<std::size_t>(k));
    std::size_t members = 0;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      members += groups[g].members.size();
      EXPECT_TRUE(g == 0 || groups[g - 1].members[0] < groups[g].members[0]);
      Vector3d mean = Vector3d::Zero();
      for (const int i : groups[g].members) {
        mean += p[i] / static_cast<double>(groups[g].members.size());
        for (const Group& other : groups) EXPECT_LE((p[i] - groups[g].mean).norm(), (p[i] - other.mean).norm() + 1e-12);
      }
      EXPECT_LT((mean - groups[g].mean).norm(), 1e-12);
    }
    EXPECT_EQ(members, p.size());
  }
}

TEST(Kmeans, FewerPlacesThanGroups) {
  const std::vector<Vector3d> p(5, Vector3d(1, 2, 3));
  ASSERT_EQ(kmeans(p, 3).size(), 1U);
  EXPECT_EQ(kmeans(p, 3)[0].members.size(), 5U);
  EXPECT_TRUE(kmeans({}, 3).empty());
}

ViewSet views(int count) {
  ViewSet out;
  out.source = "views/transforms.json";
  for (const Camera& camera : test::ring(count)) {
    ListedView view;
    view.camera = camera;
    view.name = "images/" + camera.file;
    view.camera.file = view.name;
    view.picture = "views/" + view.name;
    out.views.push_back(view);
  }
  return out;
}

TEST(ViewChoice, ByNameStemPathOrIndex) {
  ViewSet set = views(5);
  EXPECT_EQ(choose_views(set, {{"3", "images/1.png", "@0", "4.png", "images/2"}, 4}), (Indices{3, 1, 0, 4, 2}));
  EXPECT_EQ(choose_views(set, {{"./images/1.png"}, 4}), Indices{1});
  set.views[2].name = "./train/r_2";
  for (const char* name : {"./train/r_2", "train/r_2", "r_2"}) EXPECT_EQ(choose_views(set, {{name}, 4}), Indices{2});
}

TEST(ViewChoice, NamesThatDoNotDo) {
  ViewSet set = views(12);
  expect_error(Status::usage, {"13", "no such view", "12", "near it: images/1"}, [&] {
    choose_views(set, {{"13"}, 4});
  });
  expect_error(Status::usage, {"named twice"}, [&] { choose_views(set, {{"3", "@3"}, 4}); });
  for (const char* index : {"@12", "@-1", "@x", "@1x", "@99999999999"})
    expect_error(Status::usage, {index}, [&] { choose_views(set, {{index}, 4}); });
  set.views[2].picture.clear();
  expect_error(Status::usage, {"images/2.png", "picture is not there"}, [&] { choose_views(set, {{"2"}, 4}); });
  set.views[5].name = "other/7.jpg";
  expect_error(Status::usage, {"2 views", "images/7.png (@7)", "other/7.jpg (@5)"}, [&] {
    choose_views(set, {{"7"}, 4});
  });
  EXPECT_EQ(choose_views(set, {{"other/7"}, 4}), Indices{5});
  EXPECT_EQ(choose_views(set, {{"7.png"}, 4}), Indices{7});
  set = views(17);
  std::vector<std::string> all;
  for (int i = 0; i < 17; ++i) all.push_back(fmt::format("@{}", i));
  expect_error(Status::usage, {"17 views", "1 to 16"}, [&] { choose_views(set, {all, 4}); });
  all.pop_back();
  EXPECT_EQ(choose_views(set, {all, 4}).size(), 16U);
}

TEST(ViewChoice, AllWhereThereAreNoMore) {
  ViewSet set = views(5);
  test::Warnings warnings;
  EXPECT_EQ(choose_views(set, {{}, 5, 5}), (Indices{0, 1, 2, 3, 4}));
  EXPECT_EQ(choose_views(set, {{}, 16, 5}), (Indices{0, 1, 2, 3, 4}));  // as many as in training are enough
  EXPECT_TRUE(warnings.all.empty());
  set.views[0].picture.clear();
  set.views[3].picture.clear();
  EXPECT_EQ(choose_views(set, {{}, 5, 5}), (Indices{1, 2, 4}));
  ASSERT_EQ(warnings.all.size(), 1U);
  EXPECT_NE(warnings.all[0].find("3 views"), std::string::npos);
  for (ListedView& view : set.views) view.picture.clear();
  expect_error(Status::input, {"no view is left"}, [&] { choose_views(set, {{}, 5, 5}); });
  for (const int wanted : {0, -1, 17})
    expect_error(Status::usage, {fmt::format("view_count is {}", wanted), "1 to 16"}, [&] {
      choose_views(set, {{}, wanted, 4});
    });
}

TEST(ViewChoice, SpreadOutWhereThereAreMore) {
  ViewSet set = views(40);
  const Indices all = choose_views(set, {{}, 4});
  ASSERT_EQ(all.size(), 4U);
  for (int i = 0; i < 4; ++i) EXPECT_NEAR((all[(i + 1) % 4] - all[i] + 40) % 40, 10, 3);
  set.views[all[1]].picture.clear();  // only views with a picture count
  const Indices rest = choose_views(set, {{}, 4});
  EXPECT_EQ(std::count(rest.begin(), rest.end(), all[1]), 0);
  for (ListedView& view : set.views) view.camera = set.views[0].camera;  // all at one place
  EXPECT_EQ(choose_views(set, {{}, 4}).size(), 4U);
}

TEST(ViewChoice, AMaskThatIsListedMustBeThere) {
  const test::ViewFolder folder;
  ViewSet set = views(2);
  set.views[1].mask = folder / "masks/1.png";
  EXPECT_EQ(choose_views(set, {{"0"}, 4}), Indices{0});
  expect_error(Status::file, {"masks/1.png", "images/1.png"}, [&] { choose_views(set, {{"1"}, 4}); });
  folder.touch("masks/1.png");
  EXPECT_EQ(choose_views(set, {{"1"}, 4}), Indices{1});
}

}  // namespace
}  // namespace vsplat
