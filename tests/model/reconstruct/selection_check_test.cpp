#include "model/reconstruct/selection_check.h"

#include <gtest/gtest.h>

#include <numeric>

namespace vsplat {
namespace {

TEST(SelectionCheck, SharesOfAllAndOfTheFaces) {
  constexpr int R = 10;
  std::vector<int> selected;
  EXPECT_EQ(selected_shares(selected, R).all, 0);
  for (int i = 0; i < R; ++i) selected.push_back((5 * R + 5) * R + i);  // a line from face to face
  SelectedShares shares = selected_shares(selected, R);
  EXPECT_DOUBLE_EQ(shares.all, 0.01);
  EXPECT_DOUBLE_EQ(shares.faces, 2 / (1000.0 - 512));
  selected.resize(R * R * R);
  std::iota(selected.begin(), selected.end(), 0);
  shares = selected_shares(selected, R);
  EXPECT_EQ(shares.all, 1);
  EXPECT_EQ(shares.faces, 1);
  EXPECT_EQ(selected_shares({selected.data(), 1}, 1).faces, 1);
  // Each of the six faces counts.
  for (const int axis : {1, R, R * R})
    for (const int at : {0, R - 1}) {
      const int middle = 5 * (1 + R + R * R), voxel = middle + (at - 5) * axis;
      EXPECT_GT(selected_shares({&voxel, 1}, R).faces, 0) << axis << " " << at;
      EXPECT_EQ(selected_shares({&middle, 1}, R).faces, 0);
    }
}

TEST(SelectionCheck, BackgroundIsSeenAtThePicturesEdges) {
  PreparedView white{Image(8, 8, 3, 1.0f), {}}, grey{Image(8, 8, 3, 0.9f), {}}, object = white;
  for (int y = 1; y < 7; ++y)
    for (int x = 1; x < 7; ++x) object.image.at(x, y)[1] = 0;
  for (int x = 1; x < 6; ++x) object.image.at(x, 7)[2] = 0;  // at the picture's edge: 5 of its 28 pixels
  PreparedView beside = white;  // a portrait picture in a square: white to its left and right
  for (int x = 2; x < 6; ++x) beside.image.at(x, 0)[0] = beside.image.at(x, 7)[0] = 0;
  EXPECT_FALSE(shows_background(std::vector{white}));
  EXPECT_TRUE(shows_background(std::vector{grey}));
  EXPECT_FALSE(shows_background(std::vector{object}));
  EXPECT_TRUE(shows_background(std::vector{beside}));
  EXPECT_TRUE(shows_background(std::vector{object, white, grey}));
  EXPECT_FALSE(shows_background(std::vector{PreparedView{Image(1, 1, 3, 1.0f), {}}}));
}

TEST(SelectionCheck, SaysWhatToDo) {
  EXPECT_EQ(doubts_about({0.2, 0.05}, 16, true), "");
  EXPECT_EQ(doubts_about({0.6, 0.28}, 16, false), "");  // a box
  EXPECT_EQ(doubts_about({0.9, 0.9}, 4, true), "");     // 56 of 64 voxels are at faces
  const std::string background = doubts_about({0.683, 0.263}, 16, true), cut = doubts_about({0.83, 0.59}, 16, false);
  for (const char* word : {"68 %", "26 %", "masks", "alpha", "center and scale", "auto_frame estimates"})
    EXPECT_NE(background.find(word), std::string::npos) << word << ": " << background;
  for (const char* word : {"59 %", "larger", "center and scale"}) EXPECT_NE(cut.find(word), std::string::npos) << cut;
  EXPECT_EQ(cut.find("mask"), std::string::npos) << cut;
}

}  // namespace
}  // namespace vsplat
