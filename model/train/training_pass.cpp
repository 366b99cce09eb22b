#include "model/train/training_pass.h"

#include <algorithm>

#include "model/base/pose_noise.h"
#include "model/base/scene.h"
#include "model/ops/fit/loss.h"
#include "model/ops/fit/picture_target.h"
#include "model/ops/fit/sparsity_loss.h"
#include "model/ops/fit/surface_loss.h"
#include "model/ops/networks/lara_maps.h"
#include "model/ops/networks/ray_loss.h"
#include "model/render/render_backward.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// One level in every view: its losses, and the gradient by its Gaussians.
class Level {
 public:
  Level(Context& ctx, RenderOptions drawing, const DeviceGaussians& gaussians)
      : ctx_(ctx), drawing_(std::move(drawing)), gaussians_(gaussians) {
    gradient_ = {zero_gradients(ctx, gaussians.count(), gaussians.sh_degree(), gaussians.kind())};
  }

  void draw(const PassViews& views, const PassOptions& options, const SurfaceWeights& surface, LevelLoss& losses,
            std::uint64_t& intersections) {
    const float share = options.scale / static_cast<float>(views.cameras.size());
    for (std::size_t v = 0; v < views.cameras.size(); ++v) {
      const Camera& camera = views.drawn.empty() ? views.cameras[v] : views.drawn[v];
      const Tensor value = ctx_.tensor({3}, Type::f32, "loss");
      losses.push_back(value);
      if (options.network_alone && ctx_.planning()) continue;
      RenderOptions how = drawing_;
      how.near = static_cast<float>(kNearInObject);
      how.background = views.backgrounds.at(v);
      how.maps.normal = how.maps.distortion = surface.any();
      how.counts = [&](const Part& part) { return planned(camera, part, options); };
      const auto loss = [&](Context& c, const DevicePicture& picture) {
        const Shape one{1, camera.height, camera.width, 3};
        const Tensor by = c.tensor(one, Type::f32, "loss by the picture");
        picture_loss(c, {picture.colour.reshaped(one), views.targets.at(v), options.ssim_weight, value, by, share});
        PictureGradient out{by.reshaped(picture.colour.shape()), by_alpha(c, views, v, picture, options, share), {}};
        if (surface.any()) add_surface(c, camera, picture, surface, share, value, out);
        return out;
      };
      const DrawnPicture drawn = render_with_backward(ctx_, gaussians_, camera, how, loss, gradient_);
      intersections = std::max(intersections, drawn.intersections);
    }
  }

  // Adds the gradient of sparsity_weight's term.
  void thin_out(const PassOptions& options) {
    if (options.sparsity_weight <= 0) return;
    sparsity_loss(ctx_, {gaussians_.opacities, gradient_.front().opacities, options.sparsity_weight * options.scale});
  }

  GaussianGradients take() { return std::move(gradient_.front()); }

 private:
  // Gradient by alpha; empty if the view has no alpha.
  static Tensor by_alpha(Context& ctx, const PassViews& views, std::size_t v, const DevicePicture& picture,
                         const PassOptions& options, float share) {
    if (options.alpha_weight <= 0 || views.rgba.empty() || !views.rgba.at(v)) return {};
    const Tensor unused = ctx.tensor(picture.colour.shape(), Type::f32, "target over the background");
    const Tensor out = ctx.tensor(picture.alpha.shape(), Type::f32, "loss by alpha");
    picture_target(ctx, {views.rgba[v], {}, views.backgrounds[v], picture, options.alpha_weight * share, unused, out});
    return out;
  }

  // Adds the surface terms to the loss and their gradients by alpha, and by maps that have no gradients yet, to `out`.
  static void add_surface(Context& ctx, const Camera& camera, const DevicePicture& picture,
                          const SurfaceWeights& surface, float share, const Tensor& value, PictureGradient& out) {
    const Tensor view = upload_views(ctx, {camera}, static_cast<float>(kNearInObject), {});
    const LaraMaps maps = lara_maps_forward(ctx, {picture, view, 0});
    const auto like = [&](const Tensor& t) { return ctx.tensor(t.shape(), Type::f32, "loss by the surface"); };
    LaraMapsGradient by;
    by.alpha = out.alpha;
    by.normal = like(maps.normal);
    by.depth_normal = like(maps.depth_normal);
    by.distortion = like(picture.distortion);
    surface_loss(ctx, {maps.normal, maps.depth_normal, picture.alpha, picture.distortion, surface, value, by.normal,
                       by.depth_normal, by.distortion, share});
    const PictureGradient through = lara_maps_backward(ctx, {picture, view, 0, by});
    out.alpha = through.alpha;
    out.depth = through.depth;
    out.normal = through.normal;
    out.distortion = through.distortion;
  }

  // The counts that a plan assumes for a tile of a picture.
  VisibleCount planned(const Camera& camera, const Part& part, const PassOptions& options) const {
    if (options.whole && part.tiles() < tiles_along(camera.width) * tiles_along(camera.height))
      fail(Status::memory, "not enough device memory to draw a picture at once");
    VisibleCount out;
    out.gaussians = static_cast<std::uint64_t>(gaussians_.count());
    out.intersections = out.gaussians * static_cast<std::uint64_t>(part.tiles());
    constexpr std::uint64_t usual = 8;  // tiles that a Gaussian touches
    out.intersections = std::min(out.intersections, options.assumed_intersections.value_or(usual * out.gaussians));
    out.largest_key = 0xffffffffu;
    return out;
  }

  Context& ctx_;
  RenderOptions drawing_;
  const DeviceGaussians& gaussians_;
  SceneGradient gradient_;
};

// The exact poses.
std::vector<Camera> input_cameras(const PassViews& views) {
  return {views.cameras.begin(), views.cameras.begin() + views.input_views()};
}

// The loss of the predicted rays, and its gradient.
void lose_rays(Context& ctx, const Config& config, const PassViews& views, const PassOptions& options, DrawnPass& out) {
  const Tensor& predicted = out.trained.rays;
  const long rays = predicted.count() / 6;
  const Tensor target =
      ctx.upload({rays, 6}, patch_rays(input_cameras(views), config.tokens(), config.patch), Type::f32, "target rays");
  out.result.rays = ctx.tensor({1}, Type::f32, "loss of rays");
  out.drays = ctx.tensor({rays, 6}, Type::f32, "loss by rays");
  ray_loss(ctx, {predicted.reshaped({rays, 6}), target, out.result.rays, out.drays,
                 options.scale * static_cast<float>(config.share_loss_weight)});
  out.drays = out.drays.reshaped(predicted.shape());
}

}  // namespace

Network::Half begin_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options) {
  const std::vector<Camera> cameras = views.given.empty() ? input_cameras(views) : views.given;
  return network.begin(ctx, views.inputs, cameras, options.forward, options.recompute);
}

DrawnPass draw_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options,
                    Network::Half half) {
  DrawnPass out;
  out.trained = network.finish(ctx, std::move(half), options.forward);
  PassResult& result = out.result;
  result.selected = out.trained.selected;
  if (out.trained.rays) lose_rays(ctx, *network.config().as<Config>(), views, options, out);
  {
    Level level(ctx, network.drawing(), out.trained.coarse);
    level.draw(views, options, options.surface, result.coarse, result.intersections);
    level.thin_out(options);
    out.dcoarse = level.take();
  }
  if (network.config().has_fine() && options.forward.fine) {
    Level level(ctx, network.drawing(), out.trained.final);
    level.draw(views, options, {}, result.final, result.intersections);
    level.thin_out(options);
    out.dfinal = level.take();
  }
  return out;
}

PassResult finish_pass(Context& ctx, const Network& network, DrawnPass pass) {
  network.backward(ctx, pass.trained, pass.dcoarse, pass.dfinal, pass.drays);
  return std::move(pass.result);
}

PassResult training_pass(Context& ctx, const Network& network, const PassViews& views, const PassOptions& options) {
  return finish_pass(ctx, network, draw_pass(ctx, network, views, options, begin_pass(ctx, network, views, options)));
}

}  // namespace vsplat
