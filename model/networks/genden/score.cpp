#include "model/networks/genden/score.h"

#include <array>

#include "model/networks/layers/running.h"
#include "model/ops/dense/gather.h"
#include "model/ops/fit/loss.h"
#include "model/render/render_backward.h"

namespace vsplat {

void tap_fields(const DensifyTap& tap, const std::string& name, const DeviceGaussians& g) {
  tap(name + ".means", g.means);
  tap(name + ".scales", g.scales);
  tap(name + ".quats", g.quats);
  tap(name + ".opacities", g.opacities);
  tap(name + ".sh", g.sh);
}

Tensor screen_scores(Context& ctx, const DeviceGaussians& gaussians, const Tensor& images,
                     const std::vector<Camera>& cameras, const DensifyConfig& config, bool mirrored,
                     const DensifyTap& tap) {
  const Stage stage(ctx, "splat");
  RenderOptions options;
  if (mirrored) options.mirror = std::array<float, 3>{0, 0, 0};
  const Tensor pulls = ctx.tensor({gaussians.count(), 2}, Type::f32, "pulls");
  ctx.fill_zero(pulls);
  const long views = static_cast<long>(cameras.size()), height = images.dim(1), width = images.dim(2);
  const Tensor by_view = images.reshaped({views, height * width * 3});
  for (long v = 0; v < views; ++v) {
    const Tensor target = ctx.tensor({1, height * width * 3}, Type::f32, "photograph");
    gather_forward(ctx, {by_view, ctx.upload({1}, std::vector<int>{static_cast<int>(v)}, Type::i32), target});
    const PictureLossWork error = [&](Context& c, const DevicePicture& drawn) {
      PictureLoss loss;
      loss.pictures = drawn.colour.reshaped({1, height, width, 3});
      loss.target = target.reshaped({1, height, width, 3});
      loss.out = c.tensor({3}, Type::f32, "error");
      loss.dpictures = c.tensor({1, height, width, 3}, Type::f32, "error's gradient");
      loss.gradient_scale = 1.0f / static_cast<float>(views);
      loss.similarity = SimilarityKind::none;
      picture_loss(c, loss);
      return PictureGradient{loss.dpictures.reshaped({height, width, 3}), {}, {}};
    };
    screen_pulls(ctx, gaussians, cameras[static_cast<std::size_t>(v)], options, error,
                 config.score_through_clamp ? Pulls::through : Pulls::held, pulls);
  }
  const Tensor out = pull_lengths(ctx, pulls);
  if (tap && !ctx.planning()) tap("pull", pulls), tap("score", out);
  return out;
}

std::unique_ptr<Densifier> load_densifier(Context& ctx, const DensifyConfig& config, long sh_count,
                                          const WeightSource& weights) {
  return made_to_measure(ctx, "the densifier's weights",
                         [&](Context& c) { return std::make_unique<Densifier>(c, config, sh_count, weights); });
}

}  // namespace vsplat
