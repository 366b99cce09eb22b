// Drawing of whole scenes and its derivative: two cases a scene, frames by its cameras in turn.
#include "bench/render_suite.h"

#include <cmath>
#include <map>
#include <memory>
#include <random>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/scenes.h"
#include "model/base/scene.h"
#include "model/diagnose/selftest/reference/rasterize_backward.h"
#include "model/diagnose/selftest/reference/splat.h"
#include "model/diagnose/selftest/reference/surfels.h"
#include "model/render/render.h"
#include "model/render/render_backward.h"

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

ref::Options reference_options(const RenderOptions& options) {
  ref::Options out;
  out.near = static_cast<double>(options.near);
  for (std::size_t c = 0; c < 3; ++c) out.background[c] = static_cast<double>(options.background[c]);
  if (const auto& m = options.mirror) out.mirror = Eigen::Vector3f(m->data()).cast<double>();
  return out;
}

// The mean error relative to the largest value, or what one in a thousand exceeds if that is more than 2e-3. (Single
// pixels flip where alpha meets 1/255.)
double typical(std::vector<double>& errors, double largest) {
  double sum = 0;
  for (const double e : errors) {
    if (!std::isfinite(e)) return e;
    sum += e;
  }
  if (errors.empty() || largest <= 0) return INFINITY;  // nothing was compared
  const auto worst = errors.begin() + static_cast<long>(0.999 * static_cast<double>(errors.size() - 1));
  std::nth_element(errors.begin(), worst, errors.end());
  const double mean = sum / static_cast<double>(errors.size()) / largest, q = *worst / largest;
  return q > 2e-3 ? q : mean;
}

// How far what the device draws lies from the reference, relative to the largest value (or 1), in some tiles of one
// camera's picture. blend(tx, ty, x, y) has the reference's pixel.
template <class Blend>
double picture_error(Context& ctx, const Data& data, const Camera& camera, const Blend& blend) {
  const Picture got = render_picture(ctx, data.gaussians, camera, data.options);
  const int tiles_x = (camera.width + 15) / 16, tiles_y = (camera.height + 15) / 16;
  std::mt19937 engine(1);
  double largest = 1;
  std::vector<double> errors;
  for (int sample = 0; sample < 32; ++sample) {
    const int tile = static_cast<int>(engine() % static_cast<unsigned>(tiles_x * tiles_y));
    const int tx = sample == 0 ? tiles_x - 1 : tile % tiles_x, ty = sample == 0 ? tiles_y - 1 : tile / tiles_x;
    const auto pixel = blend(tx, ty);
    for (int y = 16 * ty; y < std::min(16 * ty + 16, camera.height); ++y) {
      for (int x = 16 * tx; x < std::min(16 * tx + 16, camera.width); ++x) {
        const ref::Frame want = pixel(x, y);
        const float* rgb = got.colour.at(x, y);
        for (std::size_t c = 0; c < 3; ++c) errors.push_back(std::abs(rgb[c] - want.colour[c]));
        errors.push_back(std::abs(*got.alpha.at(x, y) - want.alpha[0]));
        errors.push_back(std::abs(*got.depth.at(x, y) - want.depth[0]));
        largest = std::max({largest, want.depth[0], want.colour[0], want.colour[1], want.colour[2]});
      }
    }
  }
  return typical(errors, largest);
}

double volumes_error(Context& ctx, const Data& data, const Camera& camera) {
  const ref::Options options = reference_options(data.options);
  const std::vector<ref::Splat> splats = ref::project_all(data.scene.scene.gaussians, camera, options);
  const std::vector<const ref::Splat*> order = ref::depth_order(splats);
  return picture_error(ctx, data, camera, [&](int tx, int ty) {
    return [&options, here = in_tile(order, tx, ty)](int x, int y) {
      ref::Frame out;
      ref::blend_pixel(here, x, y, options, out);
      return out;
    };
  });
}

double surfels_error(Context& ctx, const Data& data, const Camera& camera) {
  const ref::SurfelOptions options{reference_options(data.options)};
  const Gaussians& g = data.scene.scene.gaussians;
  std::vector<ref::Surfel> all;
  for (std::size_t k = 0; k < g.count; ++k)
    if (const ref::Surfel s = ref::project_surfel(g, k, camera, options); !s.culled) all.push_back(s);
  std::stable_sort(all.begin(), all.end(), [](const auto& l, const auto& r) { return l.z < r.z; });
  return picture_error(ctx, data, camera, [&](int tx, int ty) {
    std::vector<const ref::Surfel*> here;
    for (const ref::Surfel& s : all)
      if (tx >= s.x0 && tx < s.x1 && ty >= s.y0 && ty < s.y1) here.push_back(&s);
    return [&options, here](int x, int y) {
      ref::SurfelPixel pixel;
      for (const ref::Surfel* s : here) {
        const ref::Meeting at = ref::meet(*s, x + 0.5, y + 0.5, options);
        if (at.alpha > 0 && !pixel.add(at, s->colour, s->normal, options.options.near)) break;
      }
      ref::SurfelFrame out;
      pixel.write(options.options.background, out);
      return ref::Frame(out);
    };
  });
}

double picture_error(Context& ctx, const Data& data, const Camera& camera) {
  return data.gaussians.kind() == GaussianKind::surfel ? surfels_error(ctx, data, camera)
                                                       : volumes_error(ctx, data, camera);
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

// A loss that weighs every pixel of a picture.
struct Loss {
  std::vector<float> colour, alpha, depth;
  PictureGradient there;  // on the device
};

Loss make_loss(Context& ctx, const Camera& camera) {
  const long h = camera.height, w = camera.width;
  Loss l{random_floats(3 * h * w, 1), random_floats(h * w, 2), random_floats(h * w, 3), {}};
  l.there = {ctx.upload({h, w, 3}, l.colour), ctx.upload({h, w}, l.alpha), ctx.upload({h, w}, l.depth)};
  return l;
}

// One tile as the reference's differentiation takes it: a picture of 16 x 16 pixels, those outside weighing nothing.
std::vector<double> rows_of_tile(const std::vector<const ref::Splat*>& here, const Loss& loss, const Camera& camera,
                                 int tx, int ty, const std::array<float, 3>& background) {
  std::vector<float> records, colour(768, 0.0f), alpha(256, 0.0f), depth(256, 0.0f);
  std::vector<std::uint32_t> ids;
  const double log2e = 1 / std::log(2.0);
  for (const ref::Splat* s : here) {
    ids.push_back(static_cast<std::uint32_t>(ids.size()));
    const double det = s->a * s->c - s->b * s->b;
    for (const double v :
         {s->u - 16 * tx, s->v - 16 * ty, 0.0, s->z, std::log2(s->opacity), s->b / s->a, -0.5 * log2e / s->a,
          -0.5 * log2e * s->a / det, s->colour[0], s->colour[1], s->colour[2], 0.0})
      records.push_back(static_cast<float>(v));
  }
  for (int i = 0; i < 256; ++i) {
    const int x = 16 * tx + i % 16, y = 16 * ty + i / 16;
    if (x >= camera.width || y >= camera.height) continue;
    const auto to = static_cast<std::size_t>(i),
               from =
                   static_cast<std::size_t>(y) * static_cast<std::size_t>(camera.width) + static_cast<std::size_t>(x);
    std::copy_n(&loss.colour[3 * from], 3, &colour[3 * to]);
    alpha[to] = loss.alpha[from], depth[to] = loss.depth[from];
  }
  return ref::blend_backward(records, ids, {0, static_cast<std::uint32_t>(ids.size())}, 16, 16, background, colour,
                             alpha, depth);
}

// How far the device's gradients lie from the reference's, by opacities and by constant colours, for Gaussians that
// only touch one of some tiles of one camera's picture.
double gradient_error(Context& ctx, const Data& data, const Camera& camera) {
  const Loss loss = make_loss(ctx, camera);
  const SceneGradient gradient = zero_gradient(ctx, data.gaussians);
  render_backward(ctx, data.gaussians, camera, data.options, loss.there, gradient, nullptr);
  const Gaussians got = download(ctx, gradient, data.scene.scene.gaussians.sh_degree);
  const std::vector<ref::Splat> splats =
      ref::project_all(data.scene.scene.gaussians, camera, reference_options(data.options));
  const std::vector<const ref::Splat*> order = ref::depth_order(splats);
  const int tiles_x = (camera.width + 15) / 16, tiles = tiles_x * ((camera.height + 15) / 16);
  double largest[2] = {};
  std::vector<double> errors[2];
  for (int tile = 0; tile < tiles; tile += std::max(1, tiles / 64)) {
    const int tx = tile % tiles_x, ty = tile / tiles_x;
    const std::vector<const ref::Splat*> here = in_tile(order, tx, ty);
    const std::vector<double> rows = rows_of_tile(here, loss, camera, tx, ty, data.options.background);
    const auto compare = [&](int kind, double value, double want) {
      largest[kind] = std::max(largest[kind], std::abs(want));
      errors[kind].push_back(std::abs(value - want));
    };
    for (std::size_t i = 0; i < here.size(); ++i) {
      const ref::Splat& s = *here[i];
      if (s.x1 - s.x0 != 1 || s.y1 - s.y0 != 1 || s.opacity < 1.0f / 255) continue;
      const auto k = static_cast<std::size_t>(&s - splats.data());
      compare(0, got.opacities[k], rows[10 * i] / s.opacity);
      for (std::size_t c = 0; c < 3; ++c)
        compare(1, got.sh[3 * k * got.sh_count() + c],
                s.colour[static_cast<long>(c)] > 0 ? kShC0 * rows[10 * i + 6 + c] : 0);
    }
  }
  return std::max(typical(errors[0], largest[0]), typical(errors[1], largest[1]));
}

// A picture is linear in the surfels' colours: what these are worth together, by their gradients, is what the picture
// is worth beyond its background. The whole derivative is held to the reference by the tests.
double surfels_gradient_error(Context& ctx, const Data& data, const Camera& camera) {
  const Loss loss = make_loss(ctx, camera);
  const SceneGradient gradient = zero_gradient(ctx, data.gaussians);
  render_backward(ctx, data.gaussians, camera, data.options, {loss.there.colour, {}, {}}, gradient, nullptr);
  const Gaussians& g = data.scene.scene.gaussians;
  const Gaussians by = download(ctx, gradient, g.sh_degree);
  const Picture drawn = render_picture(ctx, data.gaussians, camera, data.options);
  double parts = 0, whole = 0, size = 0;
  for (std::size_t i = 0; i < g.sh.size(); ++i) {
    const bool constant = i / 3 % g.sh_count() == 0;
    parts += static_cast<double>(by.sh[i]) * (static_cast<double>(g.sh[i]) + (constant ? 0.5 / kShC0 : 0));
  }
  for (std::size_t i = 0; i < loss.colour.size(); ++i) {
    const double beyond = drawn.colour.data[i] - (1 - drawn.alpha.data[i / 3]) * data.options.background[i % 3];
    whole += loss.colour[i] * beyond;
    size += std::pow(loss.colour[i] * beyond, 2);
  }
  return size > 0 ? std::abs(parts - whole) / std::sqrt(size) : INFINITY;
}

}  // namespace

// With drawing, to begin with, as a fit does it.
Prepared prepare_backward(Context& ctx, const std::string& name, const std::string& folder) {
  const auto d = make_data(ctx, name, folder);
  // One for all pictures of a size: a folder's cameras may differ.
  const auto losses = std::make_shared<std::map<std::pair<int, int>, Loss>>();
  for (const Camera& camera : d->scene.cameras) {
    const std::pair size(camera.width, camera.height);
    if (losses->count(size) == 0) losses->emplace(size, make_loss(ctx, camera));
  }
  const auto gradient = std::make_shared<SceneGradient>(zero_gradient(ctx, d->gaussians));
  Prepared p;
  p.kind = Kind::backward;
  p.inputs = static_cast<int>(d->scene.cameras.size());
  p.run = [&ctx, d, losses, gradient] {
    const Camera& camera = d->scene.cameras[d->next++ % d->scene.cameras.size()];
    const PictureGradient& by = losses->at({camera.width, camera.height}).there;
    render_backward(ctx, d->gaussians, camera, d->options, by, *gradient, nullptr);
  };
  p.error = [&ctx, d] {
    const auto of = d->gaussians.kind() == GaussianKind::surfel ? surfels_gradient_error : gradient_error;
    return of(ctx, *d, d->scene.cameras[0]);
  };
  p.tolerance = 1e-5;
  return p;
}

std::vector<Case> render_cases(const Options& options) {
  std::vector<Case> cases;
  std::vector<std::string> names = options.scenes.empty() ? scene_names() : scene_names(options.scenes);
  if (options.scenes.empty()) names.insert(names.end() - 1, "surfels-190k");
  for (const std::string& name : names) {
    cases.push_back(
        {name, [name, folder = options.scenes](Context& ctx) { return prepare_forward(ctx, name, folder); }});
    cases.push_back(
        {name, [name, folder = options.scenes](Context& ctx) { return prepare_backward(ctx, name, folder); }});
  }
  return cases;
}

}  // namespace vsplat::bench
