// EXR files whose picture is in a layer, as renderers write them.
#include <gtest/gtest.h>

#include "model/io/picture/image_file.h"
#include "tests/support/image_writers.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using Names = std::vector<std::string>;

class ExrLayers : public ::testing::Test {
 protected:
  // Channel i is 0.1 (i + 1) everywhere.
  std::string write(const Names& names) const {
    std::vector<std::vector<float>> planes;
    for (std::size_t i = 0; i < names.size(); ++i) planes.emplace_back(6, 0.1f * static_cast<float>(i + 1));
    write_test_exr(folder_ / "a.exr", 3, 2, names, planes, {});
    return folder_ / "a.exr";
  }
  // The linear value of each channel of a pixel, and alpha.
  std::vector<float> read(const Names& names) const {
    const Image image = read_image(write(names));
    std::vector<float> out(image.at(1, 1), image.at(1, 1) + image.channels);
    const float alpha = image.channels == 4 ? out[3] : 1;
    for (std::size_t c = 0; c < 3; ++c) out[c] = srgb_decode(out[c]) * alpha;
    return out;
  }
  void expect_read(const Names& names, const std::vector<float>& want) const {
    const std::vector<float> found = read(names);
    ASSERT_EQ(found.size(), want.size()) << names[0];
    for (std::size_t c = 0; c < want.size(); ++c) EXPECT_NEAR(found[c], want[c], 2e-3) << names[0] << ' ' << c;
  }

  test::TemporaryFolder folder_;
};

TEST_F(ExrLayers, TheOnlyOneIsThePicture) {
  expect_read({"ViewLayer.Combined.B", "ViewLayer.Combined.G", "ViewLayer.Combined.R"}, {0.3f, 0.2f, 0.1f});
  expect_read({"a.R", "a.G", "a.B", "a.A", "depth.Z"}, {0.1f, 0.2f, 0.3f, 0.4f});
  expect_read({"r", "g", "b"}, {0.1f, 0.2f, 0.3f});
  expect_read({".R", ".G", ".B"}, {0.1f, 0.2f, 0.3f});
  expect_read({"beauty.red", "beauty.green", "beauty.blue"}, {0.1f, 0.2f, 0.3f});
  expect_read({"a.Y", "a.A"}, {0.1f, 0.1f, 0.1f, 0.2f});
  expect_read({"normal.X", "normal.Y", "normal.Z", "c.R", "c.G", "c.B"}, {0.4f, 0.5f, 0.6f});
}

TEST_F(ExrLayers, OneOfSeveral) {
  expect_read({"R", "G", "B", "a.R", "a.G", "a.B"}, {0.1f, 0.2f, 0.3f});
  expect_read({"V.DiffCol.R", "V.DiffCol.G", "V.DiffCol.B", "V.Combined.R", "V.Combined.G", "V.Combined.B"},
              {0.4f, 0.5f, 0.6f});
  const std::string path = write({"a.R", "a.G", "a.B", "b.R", "b.G", "b.B"});
  test::expect_error(Status::format, {path, "2 layers", "a, b", "Combined"}, [&] { read_image(path); });
}

}  // namespace
}  // namespace vsplat
