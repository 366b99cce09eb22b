// SOG files: those of tests/golden/sog_files.py, round trips, and damage.
#include "model/io/scene/sog.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>

#include "model/io/archive/memory_zip.h"
#include "model/io/scene/sog_meta.h"
#include "model/io/scene/webp_plane.h"
#include "model/io/scene/written_gaussians.h"
#include "tests/support/golden_file.h"
#include "tests/support/refusal.h"
#include "tests/support/scenes.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using nlohmann::json;

Scene read_bytes(const std::string& bytes, SkippedGaussians* skipped = nullptr) {
  return read_sog("a.sog", std::as_bytes(std::span(bytes)), skipped);
}

std::string fixture(const std::string& name) { return test::contents_of(test::golden_file("sog/" + name)); }

// Compares a flat list with nested ones in the same order.
void expect_near(const std::vector<float>& found, const json& expected, double relative, const char* what,
                 double (*map)(double) = nullptr) {
  const json flat = expected.flatten();
  ASSERT_EQ(found.size(), flat.size()) << what;
  std::size_t i = 0;
  const std::function<void(const json&)> visit = [&](const json& v) {
    if (v.is_array()) {
      for (const json& one : v) visit(one);
      return;
    }
    const double f = map ? map(found[i]) : found[i];
    EXPECT_NEAR(f, v.get<double>(), relative * (1 + std::abs(v.get<double>()))) << what << " " << i;
    ++i;
  };
  visit(expected);
}

void expect_scene(const Scene& scene, const std::string& name) {
  SCOPED_TRACE(name);
  const json expected = json::parse(fixture(name + ".json"));
  const Gaussians& g = scene.gaussians;
  EXPECT_EQ(g.count, expected["mean"].size());
  EXPECT_EQ(g.sh_degree, expected["degree"].get<int>());
  expect_near(g.means, expected["mean"], 1e-6, "mean");
  expect_near(g.scales, expected["log_scale"], 1e-6, "scale", [](double s) { return std::log(s); });
  expect_near(g.quats, expected["quat"], 1e-6, "quat");
  expect_near(g.opacities, expected["opacity"], 1e-6, "opacity");
  expect_near(g.sh, expected["sh"], 1e-6, "sh");
}

TEST(Sog, ReadsEveryVersionAndDegree) {
  for (const char* name : {"version2_degree3", "version2_degree1", "version2_degree0", "version1_degree2"})
    expect_scene(read_bytes(fixture(std::string(name) + ".sog")), name);
  EXPECT_TRUE(read_bytes(fixture("version2_degree1.sog")).antialias);
  EXPECT_FALSE(read_bytes(fixture("version2_degree3.sog")).antialias);
}

TEST(Sog, ReadsAFolder) { expect_scene(read_sog_folder(test::golden_file("sog/folder/meta.json")), "folder"); }

class SogWriter : public ::testing::Test {
 protected:
  Scene back() const { return read_bytes(test::contents_of(path_)); }

  // The meta.json of two Gaussians.
  json written_meta(bool antialias) const {
    Scene scene;
    scene.gaussians = test::make_scene({"", 2, 0, 0, 0, ""}, 1);
    scene.antialias = antialias;
    write_sog(path_, scene);
    const std::string bytes = test::contents_of(path_);
    return json::parse(MemoryZip(path_, std::as_bytes(std::span(bytes))).read("meta.json"));
  }

  test::TemporaryFolder folder_;
  std::string path_ = folder_ / "scene.sog";
};

double root_mean_square(const std::vector<double>& errors) {
  double sum = 0;
  for (const double e : errors) sum += e * e;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

// What 256 even steps would do at worst; codebooks of the least squared error do no worse.
double even_step_error(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return (*high - *low) / 255 / 2;
}

struct ChannelErrors {
  std::vector<double> values, errors;

  void add(double value, double found) {
    values.push_back(value);
    errors.push_back(found - value);
  }
  void expect_small() const { EXPECT_LE(root_mean_square(errors), even_step_error(values)); }
};

// 300 Gaussians are fewer than the palette has vectors: spherical harmonics are rounded to the codebook alone.
TEST_F(SogWriter, ComesBackWithinTheFormatsSteps) {
  for (const int degree : {0, 1, 2, 3}) {
    SCOPED_TRACE(degree);
    Scene scene;
    scene.gaussians = test::make_scene({"", 300, degree, 0, 0, ""}, 5);
    const Gaussians& a = scene.gaussians;
    write_sog(path_, scene);
    const Scene read = back();
    const Gaussians& b = read.gaussians;
    ASSERT_EQ(b.count, a.count);
    ASSERT_EQ(b.sh_degree, degree);
    std::array<double, 3> low, high;
    low.fill(1e9);
    high.fill(-1e9);
    const auto log_of = [](float x) { return std::copysign(std::log1p(std::abs(x)), x); };
    for (std::size_t i = 0; i < a.means.size(); ++i) {
      low[i % 3] = std::min<double>(low[i % 3], log_of(a.means[i]));
      high[i % 3] = std::max<double>(high[i % 3], log_of(a.means[i]));
    }
    ChannelErrors scales, colours, harmonics;
    std::vector<bool> seen(a.count);
    for (std::size_t k = 0; k < b.count; ++k) {
      std::size_t from = 0;
      double nearest = 1e9;
      for (std::size_t j = 0; j < a.count; ++j) {
        double distance = 0;
        for (std::size_t i = 0; i < 3; ++i) distance += std::pow(a.means[3 * j + i] - b.means[3 * k + i], 2);
        if (distance < nearest) nearest = distance, from = j;
      }
      EXPECT_FALSE(seen[from]) << "every Gaussian comes back once";
      seen[from] = true;
      double dot = 0;
      for (std::size_t i = 0; i < 4; ++i) dot += static_cast<double>(a.quats[4 * from + i]) * b.quats[4 * k + i];
      EXPECT_GT(std::abs(dot), 1 - 1e-4);  // three parts within 1/255/sqrt(2), and the fourth that follows
      EXPECT_NEAR(b.opacities[k], a.opacities[from], 0.5 / 255 + 1e-6);
      for (std::size_t i = 0; i < 3; ++i) {
        const double x = a.means[3 * from + i];
        EXPECT_NEAR(b.means[3 * k + i], x, (1 + std::abs(x)) * ((high[i] - low[i]) / 65535 / 2 + 1e-6));
        scales.add(std::log(a.scales[3 * from + i]), std::log(b.scales[3 * k + i]));
        colours.add(a.sh[3 * from * a.sh_count() + i], b.sh[3 * k * b.sh_count() + i]);
        for (std::size_t j = 1; j < a.sh_count(); ++j)
          harmonics.add(a.sh[3 * (from * a.sh_count() + j) + i], b.sh[3 * (k * a.sh_count() + j) + i]);
      }
    }
    scales.expect_small();
    colours.expect_small();
    if (degree > 0) harmonics.expect_small();
  }
}

TEST_F(SogWriter, WritesTheSameBytesAgain) {
  Scene scene;
  scene.gaussians = test::make_scene({"", 5000, 3, 0, 0, ""}, 6);
  write_sog(path_, scene);
  const std::string first = test::contents_of(path_);
  write_sog(path_, scene);
  EXPECT_TRUE(first == test::contents_of(path_));
}

TEST_F(SogWriter, OneGaussianAndItsScenesFields) {
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.count = 1;
  g.means = {-1, 2, 0.5f};
  g.scales = {0.5f, 0.25f, 0};
  g.quats = {0, 0, -2, 0};
  g.opacities = {1};
  g.sh = {0.1f, 0.2f, -0.3f};
  scene.near = 0.125f;
  scene.up = {{0, -1, 0}};
  scene.mirror = {{1, 2, 3}};
  scene.detail = Detail{{4, 5, 6}, 0.01f};
  scene.offset = {1e6, 2e6, 3.5};
  scene.antialias = true;
  write_sog(path_, scene);
  const Scene read = back();
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(read.gaussians.means[i], g.means[i], 1e-6);
  for (std::size_t i = 0; i < 2; ++i) EXPECT_NEAR(read.gaussians.scales[i], g.scales[i], 1e-6);
  EXPECT_EQ(read.gaussians.scales[2], 0);
  EXPECT_EQ(read.gaussians.sh, g.sh);
  EXPECT_EQ(read.gaussians.opacities, g.opacities);
  EXPECT_GT(std::abs(read.gaussians.quats[2]), 1 - 1e-4f);
  EXPECT_EQ(read.near, scene.near);
  EXPECT_EQ(read.up, scene.up);
  EXPECT_EQ(read.mirror, scene.mirror);
  ASSERT_TRUE(read.detail);
  EXPECT_EQ(read.detail->at, scene.detail->at);
  EXPECT_EQ(read.detail->pixel, scene.detail->pixel);
  EXPECT_EQ(read.offset, scene.offset);
  EXPECT_TRUE(read.antialias);
}

// The format's description names one word, the programs that play such files another; a PLY file has a third.
TEST_F(SogWriter, AntialiasingHasTwoNames) {
  const json written = written_meta(true);
  EXPECT_EQ(written.at("antialias"), true);
  EXPECT_EQ(written.at("model"), "antialiased");
  json meta = written_meta(false);
  EXPECT_FALSE(meta.contains("antialias"));
  EXPECT_FALSE(meta.contains("model"));
  const auto antialias = [&] { return parse_sog_meta("meta.json", meta.dump()).scene.antialias; };
  EXPECT_FALSE(antialias());
  meta["antialias"] = true;
  EXPECT_TRUE(antialias());
  meta["antialias"] = false;
  for (const auto& [model, wanted] : {std::pair("default", false), {"antialiased", true}, {"mip", true}}) {
    meta["model"] = model;
    EXPECT_EQ(antialias(), wanted) << model;
  }
}

TEST_F(SogWriter, SurfelsGetAThirdScale) {
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.kind = GaussianKind::surfel;
  g.count = 1;
  g.means = {0, 0, 0};
  g.scales = {0.5f, 0.25f};
  g.quats = {1, 0, 0, 0};
  g.opacities = {0.5f};
  g.sh = {0, 0, 0};
  write_sog(path_, scene);
  const Gaussians read = back().gaussians;
  EXPECT_EQ(read.kind, GaussianKind::volume);
  EXPECT_NEAR(read.scales[2], 0.25 * kWrittenThickness, 1e-7);
}

TEST_F(SogWriter, AFailedWriteKeepsTheOldFile) {
  test::put_file(path_, "old");
  Scene scene;
  scene.gaussians = test::make_scene({"", 3, 0, 0, 0, ""}, 1);
  scene.gaussians.means[4] = std::numeric_limits<float>::quiet_NaN();
  test::expect_error(Status::input, {path_, "Gaussian 1", "mean"}, [&] { write_sog(path_, scene); });
  EXPECT_EQ(test::contents_of(path_), "old");
  EXPECT_EQ(folder_.entries().size(), 1u);
}

const std::vector<std::string> kEntries = {"meta.json",  "means_l.webp", "means_u.webp",       "scales.webp",
                                           "quats.webp", "sh0.webp",     "shN_centroids.webp", "shN_labels.webp"};

// version2_degree3.sog with another meta.json, or with another content of one entry; without the entry if it is empty.
std::string changed(const std::function<void(json&)>& edit, const std::string& entry = "",
                    const std::vector<unsigned char>& content = {}) {
  const std::string sound = fixture("version2_degree3.sog");
  const MemoryZip zip("sound", std::as_bytes(std::span(sound)));
  std::vector<NamedBytes> files;
  for (const std::string& name : kEntries) {
    std::vector<unsigned char> bytes = name == entry ? content : zip.read(name);
    if (name == "meta.json" && edit) {
      json meta = json::parse(bytes.begin(), bytes.end());
      edit(meta);
      const std::string text = meta.dump();
      bytes.assign(text.begin(), text.end());
    }
    if (!bytes.empty()) files.emplace_back(name, bytes);
  }
  const std::vector<unsigned char> out = make_zip(files);
  return {out.begin(), out.end()};
}

void expect_refused(const std::string& bytes, std::vector<std::string> words) {
  words.emplace_back("a.sog");
  test::expect_error(Status::format, words, [&] { read_bytes(bytes); });
}

TEST(SogDamage, NamesTheEntryAndTheField) {
  EXPECT_NO_THROW(read_bytes(changed([](json&) {})));
  expect_refused(changed({}, "scales.webp"), {"scales.webp"});
  expect_refused(changed({}, "meta.json"), {"meta.json"});
  expect_refused(changed({}, "quats.webp", {1, 2, 3}), {"quats.webp", "3 bytes"});
  expect_refused(changed([](json& m) { m["version"] = 3; }), {"version 3"});
  expect_refused(changed([](json& m) { m["count"] = -1; }), {"count", "-1"});
  expect_refused(changed([](json& m) { m["count"] = 200; }), {"means_l.webp", "200"});
  expect_refused(changed([](json& m) { m["count"] = 268000000; }), {"268000000", "bytes"});
  expect_refused(changed([](json& m) { m.erase("quats"); }), {"quats", "missing"});
  expect_refused(changed([](json& m) { m["means"]["mins"] = {0, 0}; }), {"means.mins", "[0,0]"});
  expect_refused(changed([](json& m) { m["means"]["maxs"][1] = "x"; }), {"means.maxs"});
  expect_refused(changed([](json& m) { m["scales"]["codebook"] = json::array(); }), {"scales.codebook"});
  expect_refused(changed([](json& m) { m["sh0"]["files"][0] = "../sh0.webp"; }), {"sh0.files"});
  expect_refused(changed([](json& m) { m["shN"]["bands"] = 4; }), {"shN.bands", "4"});
  expect_refused(changed([](json& m) { m["shN"]["bands"] = 2; }), {"shN_centroids.webp", "960", "512"});
  expect_refused(changed([](json& m) { m["shN"]["count"] = 129; }), {"shN_centroids.webp", "129"});
  expect_refused(changed([](json& m) { m["vsplat"]["near"] = -1; }), {"vsplat.near"});
  WebpPlane small;
  small.width = small.height = 8;
  small.rgba.resize(256);
  expect_refused(changed({}, "sh0.webp", encode_webp_plane(small)), {"sh0.webp", "8 x 8", "70"});
}

TEST(SogDamage, GaussiansThatCannotBeDrawnAreNamedOrCounted) {
  const test::Warnings warnings;
  // The first Gaussian has the lowest positions, the second the highest.
  const std::string far = changed([](json& m) {
    m["means"]["maxs"] = {2, 3, 100};
    m["means"]["mins"][2] = 0;
  });
  expect_refused(far, {"position 2", "88.7"});
  SkippedGaussians skipped;
  const Scene scene = read_bytes(far, &skipped);
  EXPECT_GT(skipped.not_finite, 0u);
  EXPECT_EQ(scene.gaussians.count + skipped.total(), 70u);
  EXPECT_EQ(scene.gaussians.means.size(), 3 * scene.gaussians.count);
  EXPECT_EQ(scene.gaussians.sh.size(), 48 * scene.gaussians.count);

  const std::string huge = changed([](json& m) {
    for (int i = 128; i < 256; ++i) m["scales"]["codebook"][i] = 90;
  });
  expect_refused(huge, {"Gaussian", "scale", "90"});
  read_bytes(huge, &skipped);
  EXPECT_GT(skipped.huge_scale, 0u);
  EXPECT_EQ(skipped.not_finite, 0u);

  const std::string none = changed([](json& m) {
    for (int i = 0; i < 256; i += 2) m["shN"]["codebook"][i] = nullptr;
  });
  expect_refused(none, {"spherical harmonics", "shN_centroids.webp"});
  read_bytes(none, &skipped);
  EXPECT_GT(skipped.not_finite, 0u);
}

TEST(SogDamage, CutOffAnywhereIsAnError) {
  const std::string sound = fixture("version2_degree0.sog");
  for (std::size_t n = 0; n < sound.size(); n += 13)
    test::expect_error(Status::format, {"a.sog"}, [&] { read_bytes(sound.substr(0, n)); });
}

TEST(WebpPlane, KeepsEveryByte) {
  WebpPlane plane;
  plane.width = 5;
  plane.height = 3;
  for (int i = 0; i < 60; ++i) plane.rgba.push_back(static_cast<std::uint8_t>(i % 4 == 3 && i < 40 ? 0 : 37 * i));
  const WebpPlane back = decode_webp_plane("p", encode_webp_plane(plane), 15, 15);
  EXPECT_EQ(back.width, 5);
  EXPECT_EQ(back.rgba, plane.rgba);
}

}  // namespace
}  // namespace vsplat
