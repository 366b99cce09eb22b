// Drawing of whole scenes: one case a scene, frames by its cameras in turn.
#include "model/render.h"

#include <cmath>
#include <memory>
#include <random>

#include "bench/bench.h"
#include "bench/scenes.h"
#include "tests/reference/splat.h"

namespace vsplat::bench {

namespace {

struct Data {
  BenchScene scene;
  DeviceGaussians gaussians;
  RenderOptions options;
  std::size_t next = 0;
};

// The Gaussians that touch one tile, in their order.
std::vector<const ref::Splat*> in_tile(const std::vector<const ref::Splat*>& all, int x, int y) {
  std::vector<const ref::Splat*> out;
  for (const ref::Splat* s : all)
    if (x >= s->x0 && x < s->x1 && y >= s->y0 && y < s->y1) out.push_back(s);
  return out;
}

// How far what the device draws lies from the reference, relative to the largest value (or 1), in some tiles of one
// camera's picture: the mean, or what one value in a thousand exceeds if that is more than 2e-3. (Single pixels flip
// where alpha meets 1/255.)
double picture_error(Context& ctx, const Data& data, const Camera& camera) {
  const Picture got = render_picture(ctx, data.gaussians, camera, data.options);
  ref::Options options;
  options.near = static_cast<double>(data.options.near);
  for (std::size_t c = 0; c < 3; ++c) options.background[c] = static_cast<double>(data.options.background[c]);
  if (const auto& m = data.options.mirror) options.mirror = Eigen::Vector3f(m->data()).cast<double>();
  const std::vector<ref::Splat> splats = ref::project_all(data.scene.scene.gaussians, camera, options);
  const std::vector<const ref::Splat*> order = ref::depth_order(splats);
  const int tiles_x = (camera.width + 15) / 16, tiles_y = (camera.height + 15) / 16;
  std::mt19937 engine(1);
  double largest = 1, sum = 0;
  std::vector<double> errors;
  for (int sample = 0; sample < 32; ++sample) {
    const int tile = static_cast<int>(engine() % static_cast<unsigned>(tiles_x * tiles_y));
    const int tx = sample == 0 ? tiles_x - 1 : tile % tiles_x, ty = sample == 0 ? tiles_y - 1 : tile / tiles_x;
    const std::vector<const ref::Splat*> here = in_tile(order, tx, ty);
    for (int y = 16 * ty; y < std::min(16 * ty + 16, camera.height); ++y) {
      for (int x = 16 * tx; x < std::min(16 * tx + 16, camera.width); ++x) {
        ref::Frame want;
        ref::blend_pixel(here, x, y, options, want);
        const float* rgb = got.colour.at(x, y);
        for (std::size_t c = 0; c < 3; ++c) errors.push_back(std::abs(rgb[c] - want.colour[c]));
        errors.push_back(std::abs(*got.alpha.at(x, y) - want.alpha[0]));
        errors.push_back(std::abs(*got.depth.at(x, y) - want.depth[0]));
        largest = std::max({largest, want.depth[0], want.colour[0], want.colour[1], want.colour[2]});
      }
    }
  }
  for (const double e : errors) {
    if (!std::isfinite(e)) return e;
    sum += e;
  }
  const auto worst = errors.begin() + static_cast<long>(0.999 * static_cast<double>(errors.size() - 1));
  std::nth_element(errors.begin(), worst, errors.end());
  const double mean = sum / static_cast<double>(errors.size()) / largest, q = *worst / largest;
  return q > 2e-3 ? q : mean;
}

std::shared_ptr<Data> make_data(Context& ctx, const std::string& name, const std::string& folder) {
  auto d = std::make_shared<Data>();
  d->scene = folder.empty() ? make_scene(name) : read_scene(folder, name);
  d->gaussians = upload(ctx, d->scene.scene.gaussians);
  d->options.near = d->scene.scene.near;
  d->options.mirror = d->scene.scene.mirror;
  return d;
}

Prepared prepare_forward(Context& ctx, const std::string& name, const std::string& folder) {
  const auto d = make_data(ctx, name, folder);
  Prepared p;
  p.kind = Kind::forward;
  p.inputs = static_cast<int>(d->scene.cameras.size());
  p.run = [&ctx, d] {
    const Camera& camera = d->scene.cameras[d->next++ % d->scene.cameras.size()];
    render(ctx, d->gaussians, camera, d->options);
  };
  p.error = [&ctx, d] { return picture_error(ctx, *d, d->scene.cameras[0]); };
  p.tolerance = 1e-5;
  return p;
}

}  // namespace

std::vector<Case> render_cases(const Options& options) {
  std::vector<Case> cases;
  for (const std::string& name : scene_names()) {
    cases.push_back(
        {name, [name, folder = options.scenes](Context& ctx) { return prepare_forward(ctx, name, folder); }});
  }
  return cases;
}

}  // namespace vsplat::bench
