// Walls about objects: which wall is seen where, and how they change a view.
#include "model/data/interior.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <set>

#include "model/data/training_views.h"
#include "tests/support/data_sets.h"

namespace vsplat {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;
using test::TemporaryFolder;

constexpr int kRoomSide = 24;

// Six colours whose sRGB equals their linear value, and a box in general position.
Room plain_room() {
  Room out;
  out.turn = Eigen::AngleAxisd(0.7, Vector3d(1, -2, 3).normalized()).toRotationMatrix();
  out.half = {1.5, 2, 3};
  for (std::size_t i = 0; i < 6; ++i)
    out.walls[i].material.colour =
        Vector3f(static_cast<float>(i & 1), static_cast<float>(i >> 1 & 1), static_cast<float>(i >> 2 & 1));
  return out;
}

Camera camera_at(const Vector3d& centre, const Vector3d& target) {
  Camera out;
  out.width = out.height = kRoomSide;
  out.fx = out.fy = 30, out.cx = 11.5, out.cy = 12.75;
  const Vector3d z = (target - centre).normalized(), x = z.cross(Vector3d(0.1, 1, 0.2)).normalized();
  out.w2c.block<1, 3>(0, 0) = x.transpose();
  out.w2c.block<1, 3>(1, 0) = z.cross(x).transpose();
  out.w2c.block<1, 3>(2, 0) = z.transpose();
  out.w2c.topRightCorner<3, 1>() = -out.w2c.topLeftCorner<3, 3>() * centre;
  return out;
}

// The wall at which the segment from an interior point to a distant point first leaves the box, found by walking along
// it.
int wall_by_walking(const Room& room, const Vector3d& inside, const Vector3d& direction) {
  for (double t = 0;; t += 1e-3) {
    const Vector3d at = room.turn * (inside + t * direction);
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(at[axis]) > room.half[axis]) return 2 * axis + (at[axis] > 0 ? 1 : 0);
  }
}

TEST(Room, TheWallBehindIsSeenFromInsideAndFromOutside) {
  const Room room = plain_room();
  Random random(3, 0, draw_stream);
  std::set<int> walls;
  for (int i = 0; i < 300; ++i) {
    const Vector3d inside = 0.4 * Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    const Vector3d direction =
        Vector3d(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1)).normalized();
    const int wall = wall_by_walking(room, inside, direction);
    walls.insert(wall);
    for (const double back : {0.0, 0.5, 20.0})  // the last is outside, behind the invisible wall
      EXPECT_EQ(wall_colour(room, inside - back * direction, direction),
                room.walls[static_cast<std::size_t>(wall)].material.colour)
          << i << " " << back;
  }
  EXPECT_EQ(walls.size(), 6u);
}

TEST(Room, ARayThatPassesByMeetsALargerBox) {
  Room room = plain_room();
  room.turn.setIdentity();
  EXPECT_EQ(wall_colour(room, {1.6, 0, 0}, {0, 0, 1}), room.walls[5].material.colour);
  EXPECT_EQ(wall_colour(room, {1.6, 0, 0}, {0.01, 1, 0}), room.walls[3].material.colour);
  EXPECT_EQ(wall_colour(room, {100, 0, 0}, {1, 0, 0}), Vector3d::Zero().cast<float>()) << "and away from both: black";
}

// A point of a wall has the same colour from everywhere: the sRGB of light times the gradient's value, by hand.
TEST(Room, APointOfAWallLooksTheSameFromEverywhere) {
  Room room = plain_room();
  room.light = 0.6f;
  for (Paint& wall : room.walls) {
    wall.gradient = true;
    wall.along = Vector3f(0.6f, -0.3f, 0.2f);
    wall.colours[0] = {0.1f, 0.9f, 0.3f}, wall.colours[1] = {0.8f, 0.2f, 0.4f}, wall.colours[2] = {0, 0.5f, 1};
  }
  Random random(4, 0, draw_stream);
  for (int i = 0; i < 200; ++i) {
    const Vector3d at(1.5, random.uniform(-2, 2), random.uniform(-3, 3));  // on the wall of +x, in the box's axes
    const double t = 0.6 * at.y() / 4 - 0.3 * at.z() / 6;                  // centred (u, v), along the gradient
    const Vector3f& end = room.walls[1].colours[t < 0 ? 0 : 2];
    const auto share = static_cast<float>(std::abs(2 * t));
    for (const Vector3d& from : {Vector3d(0, 0, 0), Vector3d(0.4, -0.3, 0.2), Vector3d(-0.5, 0.1, 2)}) {
      const Vector3f got = wall_colour(room, room.turn.transpose() * from, room.turn.transpose() * (at - from));
      for (int c = 0; c < 3; ++c) {
        const float linear = 0.6f * ((1 - share) * room.walls[1].colours[1][c] + share * end[c]);
        const float expected = linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
        EXPECT_NEAR(got[c], expected, 1e-4f) << i;
      }
    }
  }
}

// Pixels with alpha 1 are kept, others are composited over the wall, and alpha is 0 outside the shown part.
TEST(Room, LiesBehindWhatAViewShows) {
  Room room = plain_room();
  room.shown = {0.5, 1};
  StoredView view;
  view.masked = true;
  view.camera = camera_at({0.3, 0.2, -1.7}, {0.05, 0, 0});
  for (int i = 0; i < kRoomSide * kRoomSide; ++i)
    for (const int v : {i % 251, i * 7 % 251, 128, std::array{0, 100, 255}[static_cast<std::size_t>(i % 3)]})
      view.rgba.push_back(static_cast<std::uint8_t>(v));
  const StoredView got = in_room(view, view.camera, room);
  ASSERT_EQ(got.rgba.size(), view.rgba.size());
  int seen = 0, pure = 0;
  for (int y = 0; y < kRoomSide; ++y)
    for (int x = 0; x < kRoomSide; ++x) {
      const std::size_t at = 4 * (static_cast<std::size_t>(y) * kRoomSide + static_cast<std::size_t>(x));
      const std::uint8_t *is = &got.rgba[at], *was = &view.rgba[at];
      if (x < kRoomSide / 4 || x >= 3 * kRoomSide / 4) {
        EXPECT_EQ(is[3], 0) << x << " " << y;
        continue;
      }
      ++seen;
      EXPECT_EQ(is[3], 255);
      const Vector3d ray((x + 0.5 - 11.5) / 30, (y + 0.5 - 12.75) / 30, 1);
      const Vector3f wall = wall_colour(room, view.camera.centre(), view.camera.c2w().topLeftCorner<3, 3>() * ray);
      Vector3f corners = Vector3f::Zero();  // pixels that show a single wall
      for (const double dx : {-0.5, 0.5})
        for (const double dy : {-0.5, 0.5})
          corners += wall_colour(room, view.camera.centre(),
                                 view.camera.c2w().topLeftCorner<3, 3>() * (ray + Vector3d(dx / 30, dy / 30, 0)));
      if ((corners / 4 - wall).norm() > 1e-6f) continue;
      ++pure;
      const float a = static_cast<float>(was[3]) / 255;
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(is[c], a * static_cast<float>(was[c]) + (1 - a) * 255 * wall[c], 0.501f) << x << " " << y;
    }
  EXPECT_EQ(seen, kRoomSide * kRoomSide / 2);
  EXPECT_GT(pure, seen / 2);
  StoredView opaque = view;
  opaque.opaque = true;
  EXPECT_EQ(in_room(opaque, view.camera, room).rgba, view.rgba);
  StoredView unmasked = view;  // the area beside it is unknown: its photograph ends there
  unmasked.masked = false;
  EXPECT_EQ(in_room(unmasked, view.camera, room).rgba, view.rgba);
}

TEST(Room, RandomOnesAreLargeEnoughAndDifferentAndTheSameForTheSameNumbers) {
  int in_part = 0;
  std::set<float> lights;
  for (std::uint32_t i = 0; i < 200; ++i) {
    Random random(5, i, draw_stream), again(5, i, draw_stream);
    const Room room = random_room(random, nullptr), same = random_room(again, nullptr);
    EXPECT_EQ(room.half, same.half);
    EXPECT_EQ(room.turn, same.turn);
    EXPECT_EQ(wall_colour(room, {0, 0, 0}, {1, 0, 0}), wall_colour(same, {0, 0, 0}, {1, 0, 0}));
    EXPECT_GE(room.half.minCoeff(), 0.7);
    EXPECT_LE(room.half.maxCoeff(), 5);
    EXPECT_GE(room.shown.minCoeff(), 0.5);
    EXPECT_EQ(room.shown.maxCoeff(), 1);
    in_part += room.shown.minCoeff() < 1 ? 1 : 0;
    lights.insert(room.light);
  }
  EXPECT_NEAR(in_part, 100, 22);  // three deviations
  EXPECT_EQ(lights.size(), 200u);
}

// The requested share of a reader's items gets a background, each in all its views; the other items are unchanged.
TEST(Room, ShareOfTheObjects) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 10, 16);
  TrainingOptions options;
  options.image = 16, options.threads = 0, options.alpha = true;
  TrainingReader plain(open_data_set({folder.string()}), options);
  options.rooms = 0.3;
  TrainingReader roomy(open_data_set({folder.string()}), options);
  int rooms = 0;
  for (long step = 0; step < 100; ++step) {
    const TrainingViews was = plain.at(step, 0), is = roomy.at(step, 0);
    for (std::size_t v = 0; v < was.cameras.size(); ++v) EXPECT_EQ(is.cameras[v].w2c, was.cameras[v].w2c);
    if (is.rgba == was.rgba) {
      EXPECT_EQ(is.pictures, was.pictures);
      continue;
    }
    ++rooms;
    for (std::size_t v = 0; v < was.rgba.size(); ++v) {
      EXPECT_NE(is.rgba[v], was.rgba[v]) << "every view";
      for (std::size_t i = 3; i < is.rgba[v].size(); i += 4) EXPECT_TRUE(is.rgba[v][i] == 255 || is.rgba[v][i] == 0);
    }
  }
  EXPECT_NEAR(rooms, 30, 14);  // three deviations
}

}  // namespace
}  // namespace vsplat
