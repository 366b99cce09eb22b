// Mirrored objects, and objects with permuted colour channels.
#include "model/data/disguise.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "tests/support/data_sets.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

constexpr int kFive = 5;

// Two views in general position, with values that do not repeat.
TrainingViews disguised_views() {
  TrainingViews out;
  out.inputs = 1;
  for (int v = 0; v < 2; ++v) {
    Camera camera;
    camera.width = camera.height = kFive;
    camera.fx = 6 + v, camera.fy = 7, camera.cx = 2.25, camera.cy = 2.75 + v;
    camera.w2c.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(0.3 + v, Eigen::Vector3d(1, 2, -3 + v).normalized()).toRotationMatrix();
    camera.w2c.topRightCorner<3, 1>() = Eigen::Vector3d(0.1, -0.2, 2 + v);
    out.cameras.push_back(camera);
    std::vector<std::uint8_t> rgba;
    for (int i = 0; i < kFive * kFive; ++i)
      for (int c = 0; c < 4; ++c) rgba.push_back(static_cast<std::uint8_t>(i * 4 + c + 100 * v));
    out.rgba.push_back(v == 0 ? rgba : std::vector<std::uint8_t>());  // the second is opaque
  }
  for (int i = 0; i < 2 * kFive * kFive * 3; ++i) out.pictures.push_back(static_cast<float>(i));
  return out;
}

// The pixel at which a camera sees a point.
Eigen::Vector2d pixel(const Camera& camera, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = (camera.w2c * point.homogeneous()).head<3>();
  return {camera.fx * p.x() / p.z() + camera.cx, camera.fy * p.y() / p.z() + camera.cy};
}

TEST(Disguise, AMirroredPointIsSeenInTheMirroredPicture) {
  const TrainingViews was = disguised_views();
  TrainingViews is = was;
  mirror(is);
  for (std::size_t v = 0; v < 2; ++v) {
    const Eigen::Matrix3d turn = is.cameras[v].w2c.topLeftCorner<3, 3>();
    EXPECT_NEAR(turn.determinant(), 1, 1e-12);
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.2, 0.1, -0.3), {-0.4, 0.3, 0.2}, {0, 0, 0}}) {
      const Eigen::Vector2d a = pixel(was.cameras[v], p), b = pixel(is.cameras[v], {-p.x(), p.y(), p.z()});
      EXPECT_NEAR(b.x(), kFive - a.x(), 1e-12);
      EXPECT_NEAR(b.y(), a.y(), 1e-12);
    }
    for (std::size_t y = 0; y < kFive; ++y)
      for (std::size_t x = 0; x < kFive; ++x)
        for (std::size_t c = 0; c < 3; ++c)
          EXPECT_EQ(is.pictures[((v * kFive + y) * kFive + x) * 3 + c],
                    was.pictures[((v * kFive + y) * kFive + kFive - 1 - x) * 3 + c]);
  }
  for (std::size_t y = 0; y < kFive; ++y)
    for (std::size_t x = 0; x < kFive; ++x)
      for (std::size_t c = 0; c < 4; ++c)
        EXPECT_EQ(is.rgba[0][(y * kFive + x) * 4 + c], was.rgba[0][(y * kFive + kFive - 1 - x) * 4 + c]);
  EXPECT_TRUE(is.rgba[1].empty());
  mirror(is);
  EXPECT_EQ(is.pictures, was.pictures);
  EXPECT_TRUE(is.cameras[1].w2c.isApprox(was.cameras[1].w2c, 1e-15));
}

TEST(Disguise, ColoursAreExchangedAndAlphaIsNot) {
  const TrainingViews was = disguised_views();
  TrainingViews is = was;
  shuffle_channels(is, {2, 0, 1});
  for (std::size_t i = 0; i < was.pictures.size(); i += 3) {
    EXPECT_EQ(is.pictures[i], was.pictures[i + 2]);
    EXPECT_EQ(is.pictures[i + 1], was.pictures[i]);
    EXPECT_EQ(is.pictures[i + 2], was.pictures[i + 1]);
  }
  for (std::size_t i = 0; i < was.rgba[0].size(); i += 4) {
    EXPECT_EQ(is.rgba[0][i], was.rgba[0][i + 2]);
    EXPECT_EQ(is.rgba[0][i + 1], was.rgba[0][i]);
    EXPECT_EQ(is.rgba[0][i + 3], was.rgba[0][i + 3]);
  }
  EXPECT_TRUE(is.cameras[0].w2c.isApprox(was.cameras[0].w2c, 0));
}

// A reader's output equals that without augmentation, with the requested share mirrored and in every order of the
// channels.
TEST(Disguise, ShareOfTheObjects) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 10, 16);
  TrainingOptions options;
  options.image = 16, options.threads = 0, options.alpha = true;
  TrainingReader plain(open_data_set({folder.string()}), options);
  options.mirror = 0.3, options.shuffle_channels = 0.8;
  TrainingReader disguised(open_data_set({folder.string()}), options);
  int mirrored = 0, shuffled = 0;
  std::set<std::array<int, 3>> orders;
  for (long step = 0; step < 100; ++step) {
    TrainingViews as_is = plain.at(step, 0);
    const TrainingViews got = disguised.at(step, 0);
    if (!got.cameras[1].w2c.isApprox(as_is.cameras[1].w2c, 1e-12)) {
      ++mirrored;
      mirror(as_is);
    }
    EXPECT_TRUE(got.cameras[1].w2c.isApprox(as_is.cameras[1].w2c, 1e-12));
    std::array<int, 3> order = {0, 1, 2};
    int found = 0;
    do {
      TrainingViews other = as_is;
      shuffle_channels(other, order);
      if (other.pictures != got.pictures) continue;
      EXPECT_EQ(other.rgba, got.rgba);
      ++found;
      shuffled += order != std::array<int, 3>{0, 1, 2};
      orders.insert(order);
    } while (std::next_permutation(order.begin(), order.end()));
    EXPECT_EQ(found, 1) << step;
  }
  EXPECT_NEAR(mirrored, 30, 14);  // three deviations
  EXPECT_NEAR(shuffled, 80, 12);
  EXPECT_EQ(orders.size(), 6u);
}

}  // namespace
}  // namespace vsplat
