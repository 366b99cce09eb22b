#include "tests/support/splat_golden.h"

#include <algorithm>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/safetensors.h"

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

// picture.* or cotangent.*.
std::vector<Picture> read_pictures(const SafetensorsFile& file, const std::string& prefix) {
  const std::vector<float> colour = floats(file, prefix + ".colour"), alpha = floats(file, prefix + ".alpha"),
                           depth = floats(file, prefix + ".depth");
  const int width = number_at(file, "width"), height = number_at(file, "height");
  std::vector<Picture> pictures;
  for (int v = 0; v < number_at(file, "views"); ++v) {
    Picture p{Image(width, height, 3), Image(width, height, 1), Image(width, height, 1)};
    const auto part = [v](const std::vector<float>& all, Image& image) {
      std::copy_n(all.begin() + static_cast<long>(image.data.size()) * v, image.data.size(), image.data.begin());
    };
    part(colour, p.colour), part(alpha, p.alpha), part(depth, p.depth);
    pictures.push_back(std::move(p));
  }
  return pictures;
}

}  // namespace

std::string SplatGolden::path_of(const std::string& name) {
  const auto& committed = splat_committed();
  const bool here = std::find(committed.begin(), committed.end(), name) != committed.end();
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
  out.pictures = read_pictures(file, "picture");
  out.cotangents = read_pictures(file, "cotangent");
  out.gradient = read_gaussians(file, "grad");
  const std::vector<float> pose = floats(file, "grad.pose");
  out.pose_gradient.resize(out.cameras.size());
  for (std::size_t i = 0; i < pose.size(); ++i) out.pose_gradient[i / 6][i % 6] = pose[i];
  return out;
}

const std::vector<std::string>& splat_committed() {
  static const std::vector<std::string> names = {"one",    "seventeen", "degree2", "degree3",  "needles",
                                                 "mirror", "clamped",   "near",    "extremes", "stops",
                                                 "wide",   "one_pixel", "empty"};
  return names;
}

const std::vector<std::string>& splat_made() {
  static const std::vector<std::string> names = {"plain",      "lengths", "around", "many_needles",
                                                 "many_discs", "large",   "dense",  "many"};
  return names;
}

std::vector<std::string> splat_present() {
  std::vector<std::string> names = splat_committed();
  for (const std::string& name : splat_made())
    if (SplatGolden::exists(name)) names.push_back(name);
  return names;
}

}  // namespace vsplat::test
