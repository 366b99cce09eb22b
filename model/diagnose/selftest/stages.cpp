#include "model/diagnose/selftest/stages.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>

#include "model/networks/params/model_file.h"
#include "model/networks/vsplat/vsplat_model.h"
#include "model/render/render.h"
#include "runtime/files/safetensors.h"

extern "C" {
// In stages.S. The size is data: a compiler may take it that two objects never have the same address.
extern const std::byte vsplat_selftest_stages_begin[];
extern const std::uint64_t vsplat_selftest_stages_bytes;
}

namespace vsplat::selftest {
namespace {

// Layout of a row: harmonics [N,S,3] are S colours, with a scale for each coefficient; a single value is its own row.
std::size_t columns_of(const Shape& shape) {
  if (shape.size() < 2) return 1;
  return static_cast<std::size_t>(shape.size() == 3 && shape[2] == 3 ? shape[1] * shape[2] : shape.back());
}

std::vector<Camera> stages_cameras(const SafetensorsFile& file, int edge) {
  const auto c2w = file.floats(file.at("input.c2w")), k = file.floats(file.at("input.K"));
  std::vector<Camera> out;
  for (std::size_t v = 0; v < c2w.size() / 16; ++v) {
    Eigen::Matrix4d m;
    for (int i = 0; i < 16; ++i) m(i / 4, i % 4) = static_cast<double>(c2w[v * 16 + static_cast<std::size_t>(i)]);
    Camera camera;
    camera.w2c = m.inverse();
    camera.width = camera.height = edge;
    camera.fx = k[v * 9], camera.cx = k[v * 9 + 2], camera.fy = k[v * 9 + 4], camera.cy = k[v * 9 + 5];
    out.push_back(camera);
  }
  return out;
}

// Pixels at thresholds may differ: checks the mean error, and how many pixels are far off.
void check_picture(Checks& c, const char* what, const std::vector<float>& got, const std::vector<float>& want) {
  double largest = 1, sum = 0, off = 0;
  for (const float v : want) largest = std::max(largest, std::abs(static_cast<double>(v)));
  for (std::size_t i = 0; i < std::min(got.size(), want.size()); ++i) {
    const double error = std::abs(static_cast<double>(got[i]) - want[i]) / largest;
    sum += error;
    off += !(error <= 2e-3);
  }
  const double mean = sum / static_cast<double>(std::max<std::size_t>(want.size(), 1));
  c.that(what, got.size() == want.size() && mean <= 1e-5 && off <= 1e-3 * static_cast<double>(want.size()), mean, 1e-5);
}

void stages_all(Checks& c) {
  const SafetensorsFile file("the self-test's stages", stages_file());
  const Config config = config_from_json(file.metadata().at("config"));
  const long views = std::stol(file.metadata().at("views")), edge = config.image;
  const VsplatModel model(c.ctx, config, read_weights(file, config, "weight."));
  auto cameras = stages_cameras(file, config.image);
  const std::vector<Camera> all = cameras;
  cameras.resize(static_cast<std::size_t>(views));
  auto images = file.floats(file.at("input.images"));
  images.resize(static_cast<std::size_t>(views * edge * edge * 3));
  ForwardOptions options;
  options.temperature = std::stod(file.metadata().at("temperature"));
  options.tap = [&](const std::string& name, const Tensor& t) {
    c.close_by_column(name.c_str(), c.ctx.read<float>(t), columns_of(t.shape()), file.floats(file.at("stage." + name)),
                      1e-4);
    c.keep();  // later stages use it as input
  };
  const ForwardResult got =
      model.forward(c.ctx, c.up({views, edge, edge, 3}, images), upload_cameras(c.ctx, cameras), options);
  std::vector<std::int64_t> coords;
  const int r = config.volume;
  for (const int v : got.selected)
    for (const int at : {v / (r * r), v / r % r, v % r}) coords.push_back(at);
  c.that("selected voxels", coords == file.integers(file.at("stage.coords")));
  c.keep();
  const auto background = file.floats(file.at("input.background"));
  RenderOptions drawing;
  drawing.background = {background[0], background[1], background[2]};
  std::vector<float> colour, alpha, depth;
  for (const Camera& camera : all) {
    const Picture p = render_picture(c.ctx, got.final, camera, drawing);
    colour.insert(colour.end(), p.colour.data.begin(), p.colour.data.end());
    alpha.insert(alpha.end(), p.alpha.data.begin(), p.alpha.data.end());
    depth.insert(depth.end(), p.depth.data.begin(), p.depth.data.end());
  }
  check_picture(c, "drawn colours", colour, file.floats(file.at("render.final.image")));
  check_picture(c, "drawn alphas", alpha, file.floats(file.at("render.final.alpha")));
  check_picture(c, "drawn depths", depth, file.floats(file.at("render.final.depth")));
}

}  // namespace

Case stages_case() { return {"network", stages_all}; }

std::span<const std::byte> stages_file() {
  return {vsplat_selftest_stages_begin, static_cast<std::size_t>(vsplat_selftest_stages_bytes)};
}

}  // namespace vsplat::selftest
