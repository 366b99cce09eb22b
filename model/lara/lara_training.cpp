// The network in training: its forward, and the backward of everything in the forward's order turned round.
#include <utility>

#include "model/lara/lara_modules.h"
#include "model/ops/add_columns.h"
#include "model/ops/gather.h"

namespace vsplat {

LaraModel::Trained LaraModel::forward_in_training(Context& ctx, const Tensor& images,
                                                  const std::vector<Camera>& cameras, const LaraOptions& options,
                                                  bool recompute) const {
  Trained out;
  out.saved = std::make_shared<Saved>(recompute);
  const Coarse state = coarse(ctx, images, cameras, options, out.saved.get());
  if (recompute) hold_inputs(*out.saved, images, state);
  out.result = fine(ctx, state, options, out.saved.get());
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

// What each stage kept goes back to the arena as soon as its backward is done.
void LaraModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                         const GaussianGradients& dfinal, const LaraFeatureGradients& by) const {
  const Modules& m = *modules_;
  Saved& saved = *trained.saved;
  Tensor dvolume = ctx.tensor(saved.fine.volume.shape(), Type::f32, "gradient by volume");
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
    m.fine_decoder.backward(ctx, std::exchange(saved.fine, {}), dfine, {dvolume, dcoarse.means, {}});
  }
  saved.fine = {};
  m.coarse_decoder.backward(ctx, saved.coarse_decoder.take(ctx), dcoarse, dvolume);
  const LaraVolume::Gradients lifted = m.volume.backward(ctx, std::move(saved.volume), std::exchange(dvolume, {}));
  const Tensor dfeatures = m.lifting.backward(ctx, saved.lifting, lifted.samples, lifted.embedded);
  const Tensor dtokens = m.modulation.backward(ctx, saved.modulation.take(ctx), dfeatures);
  m.encoder.backward(ctx, saved.encoder.take(ctx), dtokens);
}

}  // namespace vsplat
