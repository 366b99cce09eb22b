// The network in training: its forward, and the backward of all stages in reverse order.
#include <utility>

#include "model/networks/vsplat/vsplat_modules.h"
#include "model/ops/dense/add_columns.h"
#include "model/ops/dense/gather.h"

namespace vsplat {

VsplatModel::CoarseHalf VsplatModel::coarse_in_training(Context& ctx, const Tensor& images,
                                                        const DeviceCameras& cameras, const ForwardOptions& options,
                                                        bool recompute) const {
  CoarseHalf out;
  out.cameras = cameras;
  out.saved = std::make_shared<Saved>(recompute);
  out.coarse = std::make_shared<Coarse>(coarse(ctx, images, cameras, options, out.saved.get()));
  out.selected = out.coarse->selected.count;
  out.saved->features_shape = out.coarse->features.shape();
  out.saved->volume_shape = out.coarse->volume.shape();
  if (recompute) hold_coarse_inputs(*out.saved, images, cameras, *out.coarse);
  return out;
}

VsplatModel::Trained VsplatModel::fine_in_training(Context& ctx, CoarseHalf half, const ForwardOptions& options) const {
  const Coarse& state = *half.coarse;
  Trained out;
  out.coarse = state.gaussians;
  out.selected = state.selected.index;
  out.rays = state.rays;
  out.final = fine(ctx, state, half.cameras, options, half.saved.get(), &out.refined);
  out.saved = std::move(half.saved);
  return out;
}

void VsplatModel::hold_coarse_inputs(Saved& saved, const Tensor& images, const DeviceCameras& cameras,
                                     const Coarse& state) const {
  const Modules& m = *modules_;
  const DeviceCameras& held = saved.cameras = cameras;
  saved.encoder.made_by([&m, images](Context& ctx, Vit::Saved& out) { m.encoder.forward(ctx, images, &out); });
  if (m.rays)
    saved.rays.made_by(
        [&m, tokens = state.tokens](Context& ctx, RayPredictor::Saved& out) { m.rays->forward(ctx, tokens, &out); });
  saved.modulation.made_by(
      [&m, &held, tokens = state.tokens, rays = state.rays](Context& ctx, PoseModulation::Saved& out) {
        m.modulation.forward(ctx, tokens, held, &out, rays);
      });
  saved.volume.made_by([&m, &held, features = state.features](Context& ctx, Saved::Volume& out) {
    m.volume.forward(ctx, m.lifting.forward(ctx, features, held, &out.lifting), &out.network);
  });
  saved.coarse_heads.made_by([&m, volume = state.volume](Context& ctx, CoarseHeads::Saved& out) {
    m.coarse_heads.forward(ctx, volume, &out);
  });
}

void VsplatModel::hold_fine_inputs(Saved& saved, const Coarse& state, const DeviceGaussians& skeleton) const {
  const Modules& m = *modules_;
  saved.fine.made_by([&m, &held = saved.cameras, skeleton, volume = state.volume, features = state.features,
                      index = state.selected.index](Context& ctx, Saved::Fine& out) {
    const Refinement::Output refined =
        m.refinement.forward(ctx, {volume, features, &held, skeleton.means, index}, &out.refinement);
    m.fine_heads.forward(ctx, refined.refined, skeleton, &out.heads);
  });
}

// Frees each stage's saved tensors as soon as its backward is done.
void VsplatModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                           const GaussianGradients& dfinal, const Tensor& drefined, Tensor drays) const {
  const Modules& m = *modules_;
  Saved& saved = *trained.saved;
  const auto zeros = [&](const Shape& shape, const char* what) {
    Tensor out = ctx.tensor(shape, Type::f32, what);
    ctx.fill_zero(out);
    return out;
  };
  const Tensor dfeatures = zeros(saved.features_shape, "gradient by features");
  Tensor dvolume = zeros(saved.volume_shape, "gradient by volume"), dlogits;

  if (config_.levels != "coarse") {
    fine_backward(ctx, trained, dcoarse, dfinal, drefined, dvolume, dfeatures);
    dlogits = select_voxels_backward(ctx, saved.selection, dcoarse.opacities);
  }
  m.coarse_heads.backward(ctx, saved.coarse_heads.take(ctx), dlogits, dcoarse, dvolume, true);
  Saved::Volume volume = saved.volume.take(ctx);
  Tensor dlifted = m.volume.backward(ctx, std::exchange(volume.network, {}), std::exchange(dvolume, {}));
  m.lifting.backward(ctx, std::exchange(volume.lifting, {}), std::exchange(dlifted, {}), dfeatures);
  if (m.rays && !drays) drays = zeros(trained.rays.shape(), "gradient by rays");
  const Tensor dtokens = m.modulation.backward(ctx, saved.modulation.take(ctx), dfeatures, drays);
  if (m.rays) m.rays->backward(ctx, saved.rays.take(ctx), drays, dtokens);
  m.encoder.backward(ctx, saved.encoder.take(ctx), dtokens);
}

void VsplatModel::fine_backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                                const GaussianGradients& dfinal, const Tensor& besides, const Tensor& dvolume,
                                const Tensor& dfeatures) const {
  GaussianGradients dskeleton = dfinal;  // if `levels` is "skeletal"
  if (config_.levels == "fine") {
    const Modules& m = *modules_;
    Saved::Fine kept = trained.saved->fine.take(ctx);
    const long p = trained.selected.dim(0);
    dskeleton = zero_gradients(ctx, p, config_.sh_degree);
    const Stage stage(ctx, "decode");
    const Tensor drefined = ctx.tensor({p, config_.fine_dim}, Type::f32, "gradient by refined");
    m.fine_heads.backward(ctx, std::exchange(kept.heads, {}), dfinal, drefined, dskeleton);
    if (besides) add_columns(ctx, {besides, drefined});
    m.refinement.backward(ctx, kept.refinement, drefined, {dvolume, dfeatures, dskeleton.means});
  }
  const Stage stage(ctx, "selection");
  gather_backward(ctx, dskeleton, trained.selected, dcoarse);
}

}  // namespace vsplat
