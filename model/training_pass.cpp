#include "model/training_pass.h"

#include <algorithm>

#include "model/ops/loss.h"
#include "model/reconstruct.h"
#include "model/render_backward.h"

namespace vsplat {
namespace {

// One level in every view: its losses, and the gradient by its Gaussians.
class Level {
 public:
  Level(Context& ctx, const Config& config, const DeviceGaussians& gaussians)
      : ctx_(ctx), config_(config), gaussians_(gaussians) {
    gradient_ = {zero_gradients(ctx, gaussians.count(), gaussians.sh_degree())};
  }

  void draw(const PassViews& views, const PassOptions& options, LevelLoss& losses, std::uint64_t& intersections) {
    const float share = options.scale / static_cast<float>(views.cameras.size());
    for (std::size_t v = 0; v < views.cameras.size(); ++v) {
      const Camera& camera = views.cameras[v];
      RenderOptions how;
      how.near = static_cast<float>(kNearInObject);
      how.background = views.backgrounds.at(v);
      if (config_.negate_camera_centre) how.mirror = std::array<float, 3>{0, 0, 0};
      if (options.assumed_intersections)
        how.counts = [&](const Part&) {
          VisibleCount all;
          all.gaussians = static_cast<std::uint64_t>(gaussians_.count());
          all.intersections = *options.assumed_intersections;
          all.largest_key = 0xffffffffu;
          return all;
        };
      const Tensor value = ctx_.tensor({3}, Type::f32, "loss");
      const auto loss = [&](Context& c, const DevicePicture& picture) {
        const Shape one{1, camera.height, camera.width, 3};
        const Tensor by = c.tensor(one, Type::f32, "loss by the picture");
        picture_loss(c, {picture.colour.reshaped(one), views.targets.at(v), options.ssim_weight, value, by, share});
        return PictureGradient{by.reshaped(picture.colour.shape()), {}, {}};
      };
      const DrawnPicture drawn = render_with_backward(ctx_, gaussians_, camera, how, loss, gradient_);
      intersections = std::max(intersections, drawn.intersections);
      losses.push_back(value);
    }
  }

  GaussianGradients take() { return std::move(gradient_.front()); }

 private:
  Context& ctx_;
  const Config& config_;
  const DeviceGaussians& gaussians_;
  SceneGradient gradient_;
};

}  // namespace

PassResult training_pass(Context& ctx, const VsplatModel& model, const PassViews& views, const PassOptions& options) {
  const Config& config = model.config();
  const std::vector<Camera> inputs(views.cameras.begin(), views.cameras.begin() + views.input_views());
  VsplatModel::Trained trained =
      model.forward_in_training(ctx, views.inputs, upload_cameras(ctx, inputs), options.forward);

  PassResult out;
  if (trained.selected) out.selected = trained.selected.dim(0);
  GaussianGradients dcoarse, dfinal;
  {
    Level level(ctx, config, trained.coarse);
    level.draw(views, options, out.coarse, out.intersections);
    dcoarse = level.take();
  }
  if (config.levels != "coarse") {
    Level level(ctx, config, trained.final);
    level.draw(views, options, out.final, out.intersections);
    dfinal = level.take();
  }
  model.backward(ctx, trained, dcoarse, dfinal);
  return out;
}

}  // namespace vsplat
