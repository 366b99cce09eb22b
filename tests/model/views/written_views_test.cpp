#include "model/views/written_views.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <random>

#include "model/io/picture/image_file.h"
#include "model/io/views/view_set.h"
#include "runtime/error.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

std::vector<PreparedView> some_views(const std::vector<std::string>& names) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<PreparedView> views;
  for (const std::string& name : names) {
    PreparedView view;
    view.image = Image(12, 12, 3);
    for (float& v : view.image.data) v = uniform(rng);
    view.camera.file = name;
    view.camera.width = view.camera.height = 12;
    view.camera.fx = 10 + uniform(rng) / 3;
    view.camera.fy = 11 + uniform(rng) / 3;
    view.camera.cx = 5 + uniform(rng);
    view.camera.cy = -7 + uniform(rng);
    view.camera.w2c.topLeftCorner<3, 3>() =
        Eigen::AngleAxisd(uniform(rng), Eigen::Vector3d(1, -2, 0.5).normalized()).toRotationMatrix();
    view.camera.w2c.topRightCorner<3, 1>() = Eigen::Vector3d(uniform(rng), uniform(rng), 1.0 / 3);
    views.push_back(view);
  }
  return views;
}

// The folder is ordinary input, and gives the same cameras to the bit and the same pictures to 8 bits.
TEST(WrittenViews, AreReadAsInput) {
  const TemporaryFolder folder;
  const std::vector<PreparedView> views = some_views({"images/a.jpg", "images/b.exr", "c"});
  write_views(folder / "new/views", views);
  const ViewSet set = read_views(folder / "new/views");
  ASSERT_EQ(set.views.size(), 3u);
  const char* names[] = {"a.png", "b.png", "c.png"};
  for (std::size_t i = 0; i < 3; ++i) {
    const Camera& got = set.views[i].camera;
    const Camera& want = views[i].camera;
    EXPECT_EQ(set.views[i].name, names[i]);
    EXPECT_EQ(got.fx, want.fx);
    EXPECT_EQ(got.fy, want.fy);
    EXPECT_EQ(got.cx, want.cx);
    EXPECT_EQ(got.cy, want.cy);
    EXPECT_LT((got.w2c - want.w2c).cwiseAbs().maxCoeff(), 1e-15);  // the reader makes rotations exactly orthonormal
    const PreparedView again = prepare_view(got, set.views[i].picture.string(), "", {.size = 12});
    for (std::size_t k = 0; k < again.image.data.size(); ++k)
      ASSERT_EQ(again.image.data[k], static_cast<float>(std::lround(255 * views[i].image.data[k])) / 255.0f);
  }
}

TEST(WrittenViews, SharedStemsGetTheirIndex) {
  const auto files = written_view_files("out", some_views({"left/1.png", "right/1.PNG", "2.png"}));
  const std::vector<std::string> want = {"out/0000_1.png", "out/0001_1.png", "out/0002_2.png", "out/cameras.json"};
  EXPECT_EQ(files, want);
  EXPECT_EQ(written_view_files("out", some_views({"A.png", "a.jpg"}))[1], "out/0001_a.png");
  EXPECT_EQ(written_view_files("out", some_views({""}))[0], "out/view.png");
}

TEST(WrittenViews, AFailureLeavesNoFile) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "b.png");
  EXPECT_THROW(write_views(folder.string(), some_views({"a", "b", "c"})), Error);
  EXPECT_FALSE(std::filesystem::exists(folder / "a.png"));
  EXPECT_FALSE(std::filesystem::exists(folder / "c.png"));
  EXPECT_FALSE(std::filesystem::exists(folder / "cameras.json"));
}

}  // namespace
}  // namespace vsplat
