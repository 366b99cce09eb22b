#include "tests/support/splat_golden.h"

#include <algorithm>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/files/safetensors.h"

namespace vsplat::test {
namespace {

std::vector<float> floats(const SafetensorsFile& file, const std::string& name) { return file.floats(file.at(name)); }

int number_at(const SafetensorsFile& file, const std::string& key) {
  const auto it = file.metadata().find(key);
  if (it == file.metadata().end()) fail(Status::format, "{}: not a scene to draw: no {}", file.path(), key);
  return std::stoi(it->second);
}

// input.* or grad.*.
Gaussians read_gaussians(const SafetensorsFile& file, const std::string& prefix) {
  Gaussians g;
  g.count = static_cast<std::size_t>(number_at(file, "count"));
  g.sh_degree = number_at(file, "degree");
  g.kind = file.at(prefix + ".scales").shape.at(1) == 2 ? GaussianKind::surfel : GaussianKind::volume;
  g.means = floats(file, prefix + ".means");
  g.scales = floats(file, prefix + ".scales");
  g.quats = floats(file, prefix + ".quats");
  g.opacities = floats(file, prefix + ".opacities");
  g.sh = floats(file, prefix + ".sh");
  return g;
}

std::vector<Camera> read_cameras(const SafetensorsFile& file) {
  const std::vector<float> w2c = floats(file, "input.w2c"), lens = floats(file, "input.intrinsics");
  std::vector<Camera> cameras(static_cast<std::size_t>(number_at(file, "views")));
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    Camera& c = cameras[v];
    c.width = number_at(file, "width"), c.height = number_at(file, "height");
    c.fx = lens[4 * v], c.fy = lens[4 * v + 1], c.cx = lens[4 * v + 2], c.cy = lens[4 * v + 3];
    for (int i = 0; i < 16; ++i) c.w2c(i / 4, i % 4) = w2c[16 * v + static_cast<std::size_t>(i)];
  }
  return cameras;
}

// Reads picture.* or cotangent.*; missing entries stay empty.
std::vector<Picture> read_pictures(const SafetensorsFile& file, const std::string& prefix) {
  const int width = number_at(file, "width"), height = number_at(file, "height");
  std::vector<Picture> pictures(static_cast<std::size_t>(number_at(file, "views")));
  const auto read = [&](const std::string& name, int channels, Image Picture::*map) {
    if (!file.find(prefix + "." + name)) return;
    const std::vector<float> all = floats(file, prefix + "." + name);
    auto from = all.begin();
    for (Picture& p : pictures) {
      p.*map = Image(width, height, channels);
      std::copy_n(from, (p.*map).data.size(), (p.*map).data.begin());
      from += static_cast<std::ptrdiff_t>((p.*map).data.size());
    }
  };
  read("colour", 3, &Picture::colour), read("alpha", 1, &Picture::alpha), read("depth", 1, &Picture::depth);
  read("normal", 3, &Picture::normal), read("median", 1, &Picture::median);
  read("distortion", 1, &Picture::distortion);
  return pictures;
}

}  // namespace

std::string SplatGolden::path_of(const std::string& name) {
  const auto in = [&name](const std::vector<std::string>& all) {
    return std::find(all.begin(), all.end(), name) != all.end();
  };
  const bool here = in(splat_committed()) || in(surfels_committed());
  return (here ? VSPLAT_SOURCE_DIR "/tests/golden/splat/" : VSPLAT_GOLDEN_DIR "/splat/") + name + ".safetensors";
}

bool SplatGolden::exists(const std::string& name) { return std::filesystem::exists(path_of(name)); }

SplatGolden SplatGolden::load(const std::string& name) {
  const SafetensorsFile file(path_of(name));
  SplatGolden out;
  out.gaussians = read_gaussians(file, "input");
  out.cameras = read_cameras(file);
  const std::vector<float> background = floats(file, "input.background");
  std::copy(background.begin(), background.end(), out.options.background.begin());
  out.options.near = floats(file, "input.near")[0];
  if (file.find("input.mirror")) {
    const std::vector<float> point = floats(file, "input.mirror");
    out.options.mirror = {point[0], point[1], point[2]};
  }
  out.options.antialias = file.find("input.antialias") != nullptr;
  if (out.gaussians.kind == GaussianKind::surfel) {
    out.options.maps = {true, true, true};
    const std::string& revision = file.metadata().at("revision");
    out.options.revision = revision == "current" ? SurfelRevision::current : SurfelRevision::lara;
  }
  out.pictures = read_pictures(file, "picture");
  out.cotangents = read_pictures(file, "cotangent");
  out.gradient = read_gaussians(file, "grad");
  const std::vector<float> pose = floats(file, "grad.pose");
  out.pose_gradient.resize(out.cameras.size());
  for (std::size_t i = 0; i < pose.size(); ++i) out.pose_gradient[i / 6][i % 6] = pose[i];
  return out;
}

const std::vector<std::string>& splat_committed() {
  static const std::vector<std::string> names = {"one",    "seventeen", "degree2", "degree3",   "needles",
                                                 "mirror", "clamped",   "near",    "extremes",  "stops",
                                                 "wide",   "one_pixel", "empty",   "antialias", "antialias_needles"};
  return names;
}

const std::vector<std::string>& splat_made() {
  static const std::vector<std::string> names = {"plain",      "lengths", "around", "many_needles",
                                                 "many_discs", "large",   "dense",  "many"};
  return names;
}

const std::vector<std::string>& surfels_committed() {
  static const std::vector<std::string> names = {"surfels_seventeen", "surfels_prime"};
  return names;
}

const std::vector<std::string>& surfels_made() {
  static const std::vector<std::string> names = {
      "surfels_plain",  "surfels_current",        "surfels_lengths",  "surfels_around",
      "surfels_edge",   "surfels_around_current", "surfels_low_pass", "surfels_low_pass_current",
      "surfels_mirror", "surfels_large",          "surfels_stops",    "surfels_empty"};
  return names;
}

std::vector<std::string> splat_present() {
  std::vector<std::string> names = splat_committed();
  for (const std::string& name : splat_made())
    if (SplatGolden::exists(name)) names.push_back(name);
  return names;
}

}  // namespace vsplat::test
