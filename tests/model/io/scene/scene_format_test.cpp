// The table of formats: which one reads a file, which one is written, and what a scene loses.
#include "model/io/scene/scene_format.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/support/golden_file.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

// Gaussians within what every format holds; surfels have two scales.
Scene random_scene(std::size_t count, int degree, GaussianKind kind = GaussianKind::volume) {
  std::mt19937 engine(7);
  std::uniform_real_distribution<float> at(-1, 1);
  Scene out;
  Gaussians& g = out.gaussians;
  g.count = count;
  g.sh_degree = degree;
  g.kind = kind;
  for (std::size_t k = 0; k < count; ++k) {
    for (int i = 0; i < 3; ++i) g.means.push_back(at(engine));
    for (int i = 0; i < scales_of(kind); ++i) g.scales.push_back(std::exp(-4 + 2 * at(engine)));
    float q[4], norm = 0;
    for (float& v : q) v = at(engine), norm += v * v;
    for (const float v : q) g.quats.push_back(v / std::sqrt(norm));
    g.opacities.push_back(0.5f + 0.45f * at(engine));
    for (std::size_t i = 0; i < 3 * g.sh_count(); ++i) g.sh.push_back(0.6f * at(engine));
  }
  return out;
}

// The place of the Gaussian of `in` that is nearest to Gaussian `k` of `of`.
std::size_t nearest(const Gaussians& in, const Gaussians& of, std::size_t k) {
  std::size_t best = 0;
  float least = INFINITY;
  for (std::size_t i = 0; i < in.count; ++i) {
    float d = 0;
    for (std::size_t c = 0; c < 3; ++c) d += std::pow(in.means[3 * i + c] - of.means[3 * k + c], 2.0f);
    if (d < least) least = d, best = i;
  }
  return best;
}

struct Rounding {
  double mean, log_scale, quat, opacity, colour, sh;
  double quat_w = quat;
};

// Compares Gaussians whose order may differ.
void expect_close(const Gaussians& got, const Gaussians& want, const Rounding& most) {
  ASSERT_EQ(got.count, want.count);
  std::vector<bool> taken(got.count);
  for (std::size_t k = 0; k < want.count; ++k) {
    const std::size_t i = nearest(got, want, k);
    ASSERT_FALSE(taken[i]);
    taken[i] = true;
    float dot = 0;
    for (std::size_t c = 0; c < 4; ++c) dot += got.quats[4 * i + c] * want.quats[4 * k + c];
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(got.means[3 * i + c], want.means[3 * k + c], most.mean);
      EXPECT_NEAR(std::log(got.scales[3 * i + c]), std::log(want.scales[3 * k + c]), most.log_scale);
      EXPECT_NEAR(got.sh[3 * i * got.sh_count() + c], want.sh[3 * k * want.sh_count() + c], most.colour);
    }
    for (std::size_t c = 0; c < 4; ++c)
      EXPECT_NEAR((dot < 0 ? -1 : 1) * got.quats[4 * i + c], want.quats[4 * k + c], c == 0 ? most.quat_w : most.quat);
    EXPECT_NEAR(got.opacities[i], want.opacities[k], most.opacity);
    for (std::size_t j = 3; j < 3 * std::min(got.sh_count(), want.sh_count()); ++j)
      EXPECT_NEAR(got.sh[3 * i * got.sh_count() + j], want.sh[3 * k * want.sh_count() + j], most.sh);
  }
}

class SceneFormats : public ::testing::Test {
 protected:
  Scene there_and_back(const std::string& name, const Scene& scene, const SceneWriteOptions& options = {}) {
    write_scene(folder_ / name, scene, options);
    return read_scene(folder_ / name);
  }

  test::TemporaryFolder folder_;
  test::Warnings warnings_;
};

TEST_F(SceneFormats, PlyKeepsEveryDegree) {
  for (int degree = 0; degree <= 4; ++degree) {
    const Scene scene = random_scene(20, degree);
    const Scene again = there_and_back("a.ply", scene);
    EXPECT_EQ(again.gaussians.sh_degree, degree);
    EXPECT_EQ(again.gaussians.means, scene.gaussians.means);
    EXPECT_EQ(again.gaussians.sh, scene.gaussians.sh);
    EXPECT_TRUE(losses(scene_format("ply"), scene).empty());
  }
  EXPECT_TRUE(warnings_.all.empty()) << warnings_.text();
}

TEST_F(SceneFormats, SpzOfEachVersionAndDegree) {
  for (int version = 2; version <= 4; ++version)
    for (int degree = 0; degree <= 4; ++degree) {
      SCOPED_TRACE("version " + std::to_string(version) + ", degree " + std::to_string(degree));
      Scene scene = random_scene(60, degree);
      scene.antialias = degree == 1;
      const Scene again = there_and_back("a.spz", scene, {version});
      EXPECT_EQ(again.gaussians.sh_degree, degree);
      EXPECT_EQ(again.antialias, scene.antialias);
      Rounding most{0x1p-23, 1 / 31.9, 0.002, 1 / 509.0, 1 / 76.0, 1 / 63.9};
      if (version == 2) {
        // w follows from the squares of the others, which are rounded to 1/127; near 0 it is the least certain.
        most.quat = 0.012;
        most.quat_w = 0.12;
      }
      expect_close(again.gaussians, scene.gaussians, most);
    }
}

TEST_F(SceneFormats, SpzPositionsAreAsFineAsTheSceneAllows) {
  for (const float size : {1e-3f, 1.0f, 300.0f, 8e6f}) {
    Scene scene = random_scene(50, 0);
    for (float& v : scene.gaussians.means) v *= size;
    const Scene again = there_and_back("a.spz", scene);
    const double step = std::max(0x1p-22, size / 4e6);
    for (std::size_t i = 0; i < scene.gaussians.means.size(); ++i)
      EXPECT_NEAR(again.gaussians.means[i], scene.gaussians.means[i], step / 2 * 1.01) << size;
  }
  Scene far_off = random_scene(2, 0);
  far_off.gaussians.means[4] = 1e7f;
  test::put_file(folder_ / "b.spz", "kept");
  test::expect_error(Status::input, {"b.spz", "10000000", "8388608"}, [&] { write_scene(folder_ / "b.spz", far_off); });
  EXPECT_EQ(test::contents_of(folder_ / "b.spz"), "kept");
}

TEST_F(SceneFormats, SplatKeepsPositionsAndScales) {
  const Scene scene = random_scene(40, 2);
  const Scene again = there_and_back("a.splat", scene);
  EXPECT_EQ(again.gaussians.sh_degree, 0);
  expect_close(again.gaussians, scene.gaussians, {0, 1e-6, 0.01, 1 / 509.0, 1 / 143.0, 0});
  const Gaussians& g = again.gaussians;
  for (std::size_t k = 1; k < g.count; ++k) {
    const auto weight = [&](std::size_t i) {
      return g.scales[3 * i] * g.scales[3 * i + 1] * g.scales[3 * i + 2] * g.opacities[i];
    };
    EXPECT_GE(weight(k - 1) * 1.02f, weight(k)) << "largest first";
  }
}

TEST_F(SceneFormats, CompressedPlyOfEachDegree) {
  for (int degree = 0; degree <= 4; ++degree) {
    Scene scene = random_scene(700, degree);
    scene.near = 0.05f;
    scene.up = {0, -1, 0};
    scene.antialias = true;
    const Scene again = there_and_back("a.compressed.ply", scene);
    EXPECT_EQ(again.gaussians.sh_degree, std::min(degree, 3));
    EXPECT_EQ(again.near, 0.05f);
    EXPECT_EQ(again.up, scene.up);
    EXPECT_TRUE(again.antialias);
    // Bounds are those of a block of 256 Gaussians: at most the range of all of them.
    expect_close(again.gaussians, scene.gaussians, {2 / 2040.0, 4 / 2040.0, 0.002, 1 / 509.0, 1.2 / 509.0, 1 / 63.9});
  }
}

TEST_F(SceneFormats, SogKeepsWhatItsPlanesHold) {
  for (int degree = 0; degree <= 3; ++degree) {
    Scene scene = random_scene(200, degree);
    scene.near = 0.05f;
    scene.up = {0, -1, 0};
    scene.antialias = true;
    const Scene again = there_and_back("a.sog", scene);
    EXPECT_EQ(again.gaussians.sh_degree, degree);
    EXPECT_EQ(again.near, 0.05f);
    EXPECT_EQ(again.up, scene.up);
    EXPECT_TRUE(again.antialias);
    // Positions: half of 2 ln 2 / 65535, times e^L, at most 2. Rotations: half of sqrt(2) / 255 in three parts, which
    // add up in the fourth, the largest. 200 Gaussians have 600 scales and colours for 256 entries; each has a vector
    // of its own in the palette.
    expect_close(again.gaussians, scene.gaussians, {2.2e-5, 0.05, 0.0084, 1 / 509.0, 0.02, 0.02});
  }
}

TEST_F(SceneFormats, GltfKeepsEveryBit) {
  for (const char* name : {"a.glb", "a.gltf"})
    for (int degree = 0; degree <= 3; ++degree) {
      Scene scene = random_scene(20, degree);
      scene.up = {0, -1, 0};
      scene.antialias = degree == 2;
      const Scene again = there_and_back(name, scene);
      const Gaussians &a = again.gaussians, &b = scene.gaussians;
      EXPECT_EQ(a.means, b.means);
      EXPECT_EQ(a.scales, b.scales);
      EXPECT_EQ(a.opacities, b.opacities);
      EXPECT_EQ(a.sh, b.sh);
      EXPECT_EQ(again.up, scene.up);
      EXPECT_EQ(again.antialias, scene.antialias);
      EXPECT_TRUE(losses(scene_format(std::string_view(name).substr(2)), scene).empty());
    }
}

TEST_F(SceneFormats, AreNotOtherFilesOfTheSameContainers) {
  const struct {
    const char* name;
    std::string bytes;
    std::vector<std::string> words;
  } all[] = {{"a.ckpt", std::string("PK\x03\x04") + std::string(26, 'x') + "archive/data.pkl", {"PyTorch"}},
             {"a.zip", std::string("PK\x03\x04") + std::string(26, 'x') + "scene.ply", {"zip archive"}},
             {"transforms.json", R"({"frames":[]})", {"list of cameras"}},
             {"a.gltf", R"({"asset":{"version":"2.0"}})", {"KHR_gaussian_splatting", "a mesh"}}};
  for (const auto& one : all) {
    test::put_file(folder_ / one.name, one.bytes);
    test::expect_error(Status::format, one.words, [&] { read_scene(folder_ / one.name); });
  }
}

TEST_F(SceneFormats, SogIsReadFromAFolderByItsMeta) {
  const std::string meta = test::golden_file("sog/folder/meta.json");
  EXPECT_GT(read_scene(meta).gaussians.count, 0u);
  const std::string text = test::contents_of(meta);
  test::expect_error(Status::format, {"in memory", "give its path"},
                     [&] { read_scene("a scene in memory", std::as_bytes(std::span(text))); });
}

TEST_F(SceneFormats, OtherGzipFilesAreNamed) {
  std::string packed(200, '\0');
  const std::string text = "ply\nformat ascii 1.0\n";
  z_stream stream{};
  ASSERT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  ASSERT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  test::put_file(folder_ / "a.ply.gz", packed);
  test::expect_error(Status::format, {"a.ply.gz", "gunzip"}, [&] { read_scene(folder_ / "a.ply.gz"); });
}

TEST_F(SceneFormats, WriteTheSameBytesEachTime) {
  const Scene scene = random_scene(3000, 3);
  for (const SceneFormat& format : scene_formats()) {
    if (!format.write) continue;
    const std::string ending(format.endings.substr(0, format.endings.find(' ')));
    write_scene(folder_ / ("a" + ending), scene);
    write_scene(folder_ / ("b" + ending), scene);
    EXPECT_EQ(test::contents_of(folder_ / ("a" + ending)), test::contents_of(folder_ / ("b" + ending))) << ending;
    EXPECT_EQ(&written_format("x" + ending), &format) << "the ending names the format";
    EXPECT_EQ(&scene_format(format.name), &format);
    EXPECT_EQ(format.lossless, losses(format, scene).empty());
    EXPECT_EQ(read_scene(folder_ / ("a" + ending)).gaussians.count, 3000u) << "its content names it, too";
  }
}

TEST_F(SceneFormats, OfSurfelsAreFlatVolumes) {
  const Scene scene = random_scene(30, 1, GaussianKind::surfel);
  for (const char* name : {"a.spz", "a.splat", "a.compressed.ply", "a.sog", "a.glb", "a.gltf"}) {
    const Scene again = there_and_back(name, scene);
    EXPECT_EQ(again.gaussians.kind, GaussianKind::volume);
    const std::size_t i = nearest(again.gaussians, scene.gaussians, 0);
    const float least = std::min(scene.gaussians.scales[0], scene.gaussians.scales[1]);
    EXPECT_NEAR(std::log(again.gaussians.scales[3 * i + 2] / least), std::log(0.01), 0.04) << name;
    const auto lost = losses(written_format(name), scene);
    EXPECT_TRUE(std::any_of(lost.begin(), lost.end(), [](const auto& s) { return s.find("surfels") != s.npos; }));
  }
  EXPECT_EQ(there_and_back("a.ply", scene).gaussians.kind, GaussianKind::surfel);
}

TEST_F(SceneFormats, TellEachLostField) {
  Scene scene = random_scene(10, 3);
  scene.near = 0.1f;
  scene.up = {0, 0, 1};
  scene.mirror = {1, 2, 3};
  scene.detail = Detail{{0, 0, 0}, 0.01f};
  scene.offset = {1e6, 0, 0};
  scene.antialias = true;
  scene.gaussians.sh[0] = 9;   // beyond the range of colours
  scene.gaussians.sh[4] = -7;  // and of coefficients
  std::string all;
  for (const std::string& sentence : losses(scene_format("splat"), scene)) all += sentence + "\n";
  for (const char* word : {"degree 3 are cut to degree 0", "near plane, 0.1", "up direction, 0 0 1", "mirror point",
                           "resolution", "offset", "anti-aliasing", "1 colour value", "1/255", "sorted"})
    EXPECT_NE(all.find(word), std::string::npos) << word << " in " << all;
  all.clear();
  for (const std::string& sentence : losses(scene_format("spz"), scene)) all += sentence + "\n";
  for (const char* word : {"1 colour coefficients", "1 coefficients outside -1 to 1", "rounded to 2.38e-07"})
    EXPECT_NE(all.find(word), std::string::npos) << word << " in " << all;
  EXPECT_EQ(all.find("anti-aliasing"), std::string::npos) << "SPZ keeps it";
}

TEST_F(SceneFormats, RefuseUnknownEndings) {
  for (const char* name : {"scene.obj", "scene", ".ply", "scene.ply.gz", "scene.compressed"})
    test::expect_error(Status::usage, {name, ".compressed.ply (PlayCanvas compressed PLY)", ".spz (SPZ)", ".splat"},
                       [&] { write_scene(name, random_scene(1, 0)); });
  EXPECT_EQ(written_format("A.PLY").name, "ply");
  EXPECT_EQ(written_format("a.Compressed.ply").name, "compressed-ply");
  test::expect_error(Status::usage, {"\"obj\"", "ply, compressed-ply, spz"}, [] { scene_format("obj"); });
}

TEST_F(SceneFormats, AreKnownByContentAndNotByName) {
  const Scene scene = random_scene(300, 1);
  for (const char* name : {"a.ply", "a.compressed.ply", "a.spz", "a.splat", "a.sog", "a.glb", "a.gltf"}) {
    write_scene(folder_ / name, scene);
    const std::string bytes = test::contents_of(folder_ / name);
    for (const char* other : {"x.ply", "x.spz", "x.splat", "x.png", "x"}) {
      test::put_file(folder_ / other, bytes);
      EXPECT_EQ(read_scene(folder_ / other).gaussians.count, 300u) << name << " called " << other;
    }
  }
  test::put_file(folder_ / "y.txt", "no scene at all");
  test::expect_error(Status::format, {"y.txt", "none of the known kinds", ".spz (SPZ)"},
                     [&] { read_scene(folder_ / "y.txt"); });
  test::put_file(folder_ / "y.jpg", "\xff\xd8\xff\xe0 0123456789");
  test::expect_error(Status::format, {"y.jpg", "JPEG picture", "a scene is expected"},
                     [&] { read_scene(folder_ / "y.jpg"); });
}

// The documents have the code's table.
TEST_F(SceneFormats, AreInTheDocuments) {
  const std::string text = test::contents_of(test::golden_file("../../model/io/README.md"));
  const std::size_t heading = text.find("| format (name) |");
  ASSERT_NE(heading, text.npos);
  const std::size_t begin = text.find('\n', text.find('\n', heading) + 1) + 1;
  std::string rows;
  const auto degree = [](bool has, int most) { return has ? fmt::format("SH {}", most) : std::string("no"); };
  for (const SceneFormat& f : scene_formats()) {
    std::string endings(f.endings);
    for (std::size_t at = 0; (at = endings.find(' ', at)) != endings.npos; at += 3) endings.replace(at, 1, "` `");
    rows += fmt::format("| {} (`{}`) | `{}` | {} | {} | {} | {} | {} |\n", f.title, f.name, endings,
                        degree(f.read, f.sh_read), degree(f.write, f.sh_written), f.lossless ? "yes" : "no", f.lost,
                        f.opened_by);
  }
  EXPECT_EQ(text.substr(begin, text.find("\n\n", begin) + 1 - begin), rows);
}

TEST_F(SceneFormats, AreNotWrittenWithValuesThatCannotBeDrawn) {
  for (const char* name : {"a.spz", "a.splat", "a.compressed.ply", "a.sog", "a.glb", "a.gltf", "a.ply"}) {
    Scene scene = random_scene(5, 1);
    test::put_file(folder_ / name, "kept");
    scene.gaussians.means[7] = NAN;
    test::expect_error(Status::input, {name, "Gaussian 2", "nothing is written"},
                       [&] { write_scene(folder_ / name, scene); });
    scene = random_scene(5, 1);
    scene.gaussians.sh[3 * 4 * 3 + 5] = INFINITY;
    test::expect_error(Status::input, {name, "Gaussian 3"}, [&] { write_scene(folder_ / name, scene); });
    EXPECT_EQ(test::contents_of(folder_ / name), "kept");
    EXPECT_EQ(folder_.entries().size(), 1u) << "no temporary file stays";
    std::filesystem::remove(folder_ / name);
  }
  for (const char* name : {"a.spz", "a.splat", "a.compressed.ply", "a.sog", "a.glb", "a.gltf"})
    test::expect_error(Status::input, {"without Gaussians"}, [&] { write_scene(folder_ / name, Scene()); });
}

}  // namespace
}  // namespace vsplat
