// Files of every format made from its description by tests/golden/scene_files.py: read as it says.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "model/io/scene/scene_format.h"
#include "runtime/error.h"
#include "tests/support/golden_file.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

// NAME.values of scene_files.py.
struct Expected {
  explicit Expected(const std::string& path) : bytes(test::contents_of(path)) {
    count = static_cast<std::size_t>(whole());
    degree = whole();
    antialias = whole();
    functions = static_cast<std::size_t>(degree + 1) * static_cast<std::size_t>(degree + 1);
    means = floats(3);
    scales = floats(3);
    quats = floats(4);
    opacities = floats(1);
    sh = floats(3 * functions);
    EXPECT_EQ(at, bytes.size());
  }

  std::size_t count = 0, functions = 1;
  int degree = 0, antialias = 0;
  std::vector<float> means, scales, quats, opacities, sh;

 private:
  int whole() {
    int out = 0;
    std::memcpy(&out, bytes.data() + at, sizeof out);
    at += sizeof out;
    return out;
  }
  std::vector<float> floats(std::size_t each) {
    std::vector<float> out(each * count);
    std::memcpy(out.data(), bytes.data() + at, out.size() * sizeof(float));
    at += out.size() * sizeof(float);
    return out;
  }

  std::string bytes;
  std::size_t at = 0;
};

// Within rounding to float in a few steps.
void expect_near(const std::vector<float>& got, const std::vector<float>& want, const char* what) {
  ASSERT_EQ(got.size(), want.size()) << what;
  for (std::size_t i = 0; i < got.size(); ++i)
    ASSERT_NEAR(got[i], want[i], 1e-6 * std::max(1.0f, std::abs(want[i]))) << what << " " << i;
}

// q and -q are one rotation.
void expect_same_rotations(std::vector<float> got, const std::vector<float>& want) {
  ASSERT_EQ(got.size(), want.size());
  for (std::size_t k = 0; k < got.size(); k += 4) {
    float dot = 0;
    for (std::size_t i = 0; i < 4; ++i) dot += got[k + i] * want[k + i];
    for (std::size_t i = 0; dot < 0 && i < 4; ++i) got[k + i] *= -1;
  }
  expect_near(got, want, "rotations");
}

void expect_scene(const Scene& scene, const Expected& want) {
  const Gaussians& g = scene.gaussians;
  ASSERT_EQ(g.count, want.count);
  ASSERT_EQ(g.sh_degree, want.degree);
  EXPECT_EQ(scene.antialias, want.antialias != 0);
  expect_near(g.means, want.means, "means");
  expect_near(g.scales, want.scales, "scales");
  expect_same_rotations(g.quats, want.quats);
  expect_near(g.opacities, want.opacities, "opacities");
  expect_near(g.sh, want.sh, "sh");
}

TEST(SceneFiles, AreReadAsTheirFormatsSay) {
  const std::filesystem::path folder = test::golden_file("scenes");
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string path = entry.path().string();
    if (path.ends_with(".values")) continue;
    SCOPED_TRACE(path);
    ++files;
    const Expected want(path + ".values");
    expect_scene(read_scene(path), want);
    const std::string bytes = test::contents_of(path);
    SkippedGaussians skipped;
    expect_scene(read_scene("memory", std::as_bytes(std::span(bytes)), &skipped), want);
    EXPECT_EQ(skipped.total(), 0u);
  }
  EXPECT_GE(files, 42);
}

// A cut file is an error, whatever its length: nothing is read beyond its end, and nothing is made up.
TEST(SceneFiles, CutAnywhereAreErrors) {
  const std::string folder = test::golden_file("scenes/");
  for (const char* name : {"version1_degree1.spz", "version3_degree2.spz", "version4_degree3.spz", "frame6_old.spz",
                           "degree2.compressed.ply", "degree4.ply"}) {
    const std::string whole = test::contents_of(folder + name);
    ASSERT_GT(whole.size(), 100u);
    for (std::size_t size = 1; size < whole.size(); size += 1 + size / 50) {
      const std::string cut = whole.substr(0, size);
      EXPECT_THROW(read_scene(name, std::as_bytes(std::span(cut))), Error) << name << " of " << size << " bytes";
    }
  }
}

}  // namespace
}  // namespace vsplat
