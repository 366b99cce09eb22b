// Surfels in PLY files.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/model/io/scene/ply_fixture.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using test::floats;

class PlySurfels : public test::PlyFixture {};

// Volumes without their third scales.
Gaussians make_surfels(std::size_t count) {
  Gaussians g = test::make_scene({"", count, 2, 0, 0, ""}, 1);
  g.kind = GaussianKind::surfel;
  std::vector<float> scales;
  for (std::size_t k = 0; k < count; ++k) scales.insert(scales.end(), &g.scales[3 * k], &g.scales[3 * k] + 2);
  g.scales = scales;
  return g;
}

// A surfel has two scales and its file no third one, by which other programs identify surfels.
TEST_F(PlySurfels, SurfelsAreWrittenWithTwoScales) {
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.kind = GaussianKind::surfel;
  g.count = 2;
  g.means = {1, 2, 3, 4, 5, 6};
  g.scales = {0.5f, 0.25f, 2, 1};
  g.quats = {1, 0, 0, 0, 0, 0, 0, 1};
  g.opacities = {0.5f, 0.5f};
  g.sh = {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f};
  write_ply(path(), scene);
  const std::string written = bytes();
  const std::size_t end = written.find("end_header\n") + 11;
  EXPECT_NE(written.find("property float scale_1\nproperty float rot_0\n"), std::string::npos);
  EXPECT_EQ(written.find("scale_2"), std::string::npos);
  const auto log = [](float x) { return static_cast<float>(std::log(static_cast<double>(x))); };
  EXPECT_EQ(written.substr(end), floats({1, 2, 3, 0, 0, 0, 0.1f, 0.2f, 0.3f, 0, log(0.5f), log(0.25f), 1, 0, 0, 0,
                                         4, 5, 6, 0, 0, 0, 0.4f, 0.5f, 0.6f, 0, log(2),    0,          0, 0, 0, 1}));
}

TEST_F(PlySurfels, SurfelsComeBack) {
  for (const std::size_t count : {0, 1, 7, 4097}) {
    Scene scene;
    scene.gaussians = make_surfels(count);
    write_ply(path(), scene);
    const Gaussians &a = scene.gaussians, b = read_ply(path()).gaussians;
    ASSERT_EQ(a.count, b.count);
    EXPECT_EQ(b.kind, GaussianKind::surfel);
    EXPECT_EQ(a.means, b.means);
    EXPECT_EQ(a.sh, b.sh);
    ASSERT_EQ(a.scales.size(), b.scales.size());
    for (std::size_t i = 0; i < a.scales.size(); ++i) EXPECT_NEAR(b.scales[i], a.scales[i], 1e-6 * a.scales[i]);
    for (std::size_t i = 0; i < a.quats.size(); ++i) EXPECT_NEAR(b.quats[i], a.quats[i], 1e-6);
  }
  EXPECT_EQ(warnings_.text(), "");
}

TEST_F(PlySurfels, SurviveDamage) { expect_survives_damage(make_surfels(20)); }

// As other programs write them: as text, in another order.
TEST_F(PlySurfels, ReadsOthersSurfels) {
  put("ply\nformat ascii 1.0\nelement vertex 1\nproperty float scale_1\nproperty float rot_0\nproperty float rot_1\n"
      "property float rot_2\nproperty float rot_3\nproperty float scale_0\nproperty float x\nproperty float y\n"
      "property float z\nproperty float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float "
      "opacity\nend_header\n0 0 2 0 0 -100 1 2 3 0.1 0.2 0.3 0\n");
  const Gaussians g = read_ply(path()).gaussians;
  EXPECT_EQ(g.kind, GaussianKind::surfel);
  EXPECT_EQ(g.scales, (std::vector<float>{static_cast<float>(std::exp(-100.0)), 1}));
  EXPECT_EQ(g.quats, (std::vector<float>{0, 1, 0, 0}));
}

TEST_F(PlySurfels, SurfelsThatCannotBeDrawnAreNamed) {
  const std::string head =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
      "property float f_dc_0\nproperty float f_dc_1\nproperty float f_dc_2\nproperty float opacity\nproperty float "
      "scale_0\nproperty float scale_1\nproperty float rot_0\nproperty float rot_1\nproperty float rot_2\nproperty "
      "float rot_3\nend_header\n";
  std::vector<float> row{1, 2, 3, 0.1f, 0.2f, 0.3f, 0, -1, 100, 1, 0, 0, 0};
  EXPECT_NE(complaint(head + floats(row)).find("Gaussian 0, scale_1"), std::string::npos);
  row[8] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(complaint(head + floats(row)).find("Gaussian 0, scale_1"), std::string::npos);
  row[8] = -2, row[9] = 0;
  EXPECT_NE(complaint(head + floats(row)).find("Gaussian 0, rot_0"), std::string::npos);
}

}  // namespace
}  // namespace vsplat
