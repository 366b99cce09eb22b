// The network in training: its forward, and the backward of all stages in reverse order.
#include <utility>

#include "model/networks/lara/lara_modules.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/gather.h"
#include "model/render/render_backward.h"

namespace vsplat {

LaraModel::CoarseHalf LaraModel::coarse_in_training(Context& ctx, const Tensor& images,
                                                    const std::vector<Camera>& cameras, const LaraOptions& options,
                                                    bool recompute) const {
  CoarseHalf out;
  out.saved = std::make_shared<Saved>(recompute);
  out.coarse = std::make_shared<Coarse>(coarse(ctx, images, cameras, options, out.saved.get()));
  if (recompute) hold_inputs(*out.saved, images, *out.coarse);
  out.kept = out.coarse->index.dim(0);
  return out;
}

LaraModel::Trained LaraModel::fine_in_training(Context& ctx, CoarseHalf half, const LaraOptions& options) const {
  Trained out;
  if (options.fine)
    out.result = fine(ctx, *half.coarse, options, half.saved.get());
  else
    out.result.coarse = half.coarse->gaussians;
  out.saved = std::move(half.saved);
  return out;
}

void LaraModel::hold_inputs(Saved& saved, const Tensor& images, const Coarse& state) const {
  const Modules& m = *modules_;
  const DeviceCameras& held = saved.cameras;
  saved.encoder.made_by([&m, images](Context& ctx, Vit::Saved& out) { m.encoder.forward(ctx, images, &out); });
  saved.modulation.made_by([&m, &held, tokens = state.tokens](Context& ctx, LaraModulation::Saved& out) {
    m.modulation.forward(ctx, tokens, held, &out);
  });
  saved.coarse_decoder.made_by([&m, volume = state.volume](Context& ctx, LaraCoarseDecoder::Saved& out) {
    m.coarse_decoder.forward(ctx, volume, &out);
  });
}

void LaraModel::drawings_backward(Context& ctx, const Saved& saved, const Tensor& dmaps,
                                  const GaussianGradients& dcoarse) const {
  const bool by_alpha = config_.kind == "surfel";
  for (std::size_t v = 0; v < saved.drawn_from.size(); ++v) {
    const Camera& camera = saved.drawn_from[v];
    const Shape pixels{1, camera.height, camera.width}, colours{1, camera.height, camera.width, 3};
    const auto loss = [&](Context& c, const DevicePicture& picture) {
      const ViewDrawings drawn{picture.colour.reshaped(colours), picture.alpha.reshaped(pixels),
                               picture.depth.reshaped(pixels)};
      const auto like = [&](const Tensor& t) { return c.tensor(t.shape(), Type::f32, "gradient by a drawing"); };
      const PictureGradient out{like(picture.colour), like(picture.alpha), like(picture.depth)};
      view_maps_backward(c, {drawn,
                             static_cast<long>(v),
                             by_alpha,
                             dmaps,
                             {out.colour.reshaped(colours), out.alpha.reshaped(pixels), out.depth.reshaped(pixels)}});
      return out;
    };
    render_with_backward(ctx, saved.drawn, camera, drawing_of(config_), loss, {dcoarse});
  }
}

// Frees each stage's saved tensors as soon as its backward is done.
void LaraModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                         const GaussianGradients& dfinal, const LaraFeatureGradients& by) const {
  const Modules& m = *modules_;
  Saved& saved = *trained.saved;
  Tensor dvolume = ctx.tensor(saved.volume_shape, Type::f32, "gradient by volume");
  ctx.fill_zero(dvolume);
  if (dfinal.sh) {
    const long p = saved.index.dim(0), colours = 3L * config_.sh_count(), features = config_.fine_features;
    {
      const Stage stage(ctx, "selection");
      gather_backward(ctx, dfinal, saved.index, dcoarse);
    }
    const Tensor dfine = ctx.tensor({p, features + colours}, Type::f32, "gradient by the fine decoder's");
    ctx.fill_zero(dfine);
    add_columns(ctx, {dfinal.sh.reshaped({p, colours}), dfine, features});
    if (by.features) add_columns(ctx, {by.features, dfine});
    if (by.voxels) gather_backward(ctx, {by.voxels, saved.index, dvolume, 0, config_.primitives});
    Tensor dmaps;
    if (!saved.drawn_from.empty()) {
      dmaps = ctx.tensor(saved.fine.maps.shape(), Type::f32, "gradient by view maps");
      ctx.fill_zero(dmaps);
    }
    m.fine_decoder.backward(ctx, std::exchange(saved.fine, {}), dfine, {dvolume, dcoarse.means, dmaps});
    if (dmaps) drawings_backward(ctx, saved, dmaps, dcoarse);
  }
  saved.drawn = {};
  saved.fine = {};
  m.coarse_decoder.backward(ctx, saved.coarse_decoder.take(ctx), dcoarse, dvolume);
  const LaraVolume::Gradients lifted = m.volume.backward(ctx, std::move(saved.volume), std::exchange(dvolume, {}));
  const Tensor dfeatures = m.lifting.backward(ctx, saved.lifting, lifted.samples, lifted.embedded);
  const Tensor dtokens = m.modulation.backward(ctx, saved.modulation.take(ctx), dfeatures);
  m.encoder.backward(ctx, saved.encoder.take(ctx), dtokens);
}

}  // namespace vsplat
