// The network in training: its forward, and the backward of everything in the forward's order turned round.
#include <utility>

#include "model/network/vsplat_modules.h"
#include "model/ops/gather.h"

namespace vsplat {

VsplatModel::Trained VsplatModel::forward_in_training(Context& ctx, const Tensor& images, const DeviceCameras& cameras,
                                                      const ForwardOptions& options, const KeepOptions& keep) const {
  Trained out;
  out.saved = std::make_shared<Saved>();
  Saved& saved = *out.saved;
  if (keep.recompute) saved.again.emplace();
  const Coarse state = coarse(ctx, images, cameras, options, &saved);
  if (keep.on_selected && config_.levels != "coarse") keep.on_selected(state.selected.count);
  out.coarse = state.gaussians;
  out.selected = state.selected.index;
  saved.features = state.features.shape();
  saved.volume = state.volume.shape();
  if (saved.again) {
    Saved::Inputs& inputs = *saved.again;
    inputs.images = images;
    inputs.cameras = cameras;
    inputs.features = state.features;
    inputs.volume = state.volume;
  }
  out.final = fine(ctx, state, cameras, options, &saved);
  return out;
}

void VsplatModel::run_fine_again(Context& ctx, Saved& saved) const {
  Saved::Inputs& inputs = *saved.again;
  const DeviceGaussians skeleton = std::exchange(inputs.skeleton, {});
  const Stage stage(ctx, "refinement");
  const Refinement::Output refined = modules_->refinement.forward(
      ctx, {inputs.volume, inputs.features, &inputs.cameras, skeleton.means, std::exchange(inputs.index, {})},
      &saved.refinement);
  modules_->fine_heads.forward(ctx, refined.refined, skeleton, &saved.fine_heads);
}

void VsplatModel::run_volume_again(Context& ctx, Saved& saved) const {
  const Saved::Inputs& inputs = *saved.again;
  modules_->volume.forward(ctx, modules_->lifting.forward(ctx, inputs.features, inputs.cameras, &saved.lifting),
                           &saved.volume_network);
}

void VsplatModel::backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                           const GaussianGradients& dfinal) const {
  const Modules& m = *modules_;
  Saved& saved = *trained.saved;
  Saved::Inputs* const again = saved.again ? &*saved.again : nullptr;
  const auto zeros = [&](const Shape& shape, const char* what) {
    Tensor out = ctx.tensor(shape, Type::f32, what);
    ctx.fill_zero(out);
    return out;
  };
  // What each stage kept goes back to the arena as soon as its backward is done.
  const Tensor dfeatures = zeros(saved.features, "gradient by features");
  Tensor dvolume = zeros(saved.volume, "gradient by volume");
  if (config_.levels == "fine") {
    if (again) run_fine_again(ctx, saved);
    const long p = trained.selected.dim(0);
    const GaussianGradients dskeleton = zero_gradients(ctx, p, config_.sh_degree);
    {
      const Stage stage(ctx, "decode");
      const Tensor drefined = ctx.tensor({p, config_.fine_dim}, Type::f32, "gradient by refined");
      m.fine_heads.backward(ctx, std::exchange(saved.fine_heads, {}), dfinal, drefined, dskeleton);
      const Stage refinement(ctx, "refinement");
      m.refinement.backward(ctx, std::exchange(saved.refinement, {}), drefined, {dvolume, dfeatures, dskeleton.means});
    }
    const Stage stage(ctx, "selection");
    gather_backward(ctx, dskeleton, trained.selected, dcoarse);
  } else if (config_.levels == "skeletal") {
    const Stage stage(ctx, "selection");
    gather_backward(ctx, dfinal, trained.selected, dcoarse);
  }
  Tensor dlogits;
  if (config_.levels != "coarse") {
    const Stage stage(ctx, "selection");
    dlogits = select_voxels_backward(ctx, saved.selection, dcoarse.opacities);
  }
  {
    const Stage stage(ctx, "heads");
    if (again) m.coarse_heads.forward(ctx, std::exchange(again->volume, {}), &saved.coarse_heads);
    m.coarse_heads.backward(ctx, std::exchange(saved.coarse_heads, {}), dlogits, dcoarse, dvolume, true);
  }
  if (again) run_volume_again(ctx, saved);
  Tensor dlifted;
  {
    const Stage stage(ctx, "volume");
    dlifted = m.volume.backward(ctx, std::exchange(saved.volume_network, {}), std::exchange(dvolume, {}));
  }
  {
    const Stage stage(ctx, "lifting");
    m.lifting.backward(ctx, std::exchange(saved.lifting, {}), std::exchange(dlifted, {}), dfeatures);
  }
  Tensor dtokens;
  {
    const Stage stage(ctx, "modulation");
    if (again) {
      again->features = {};
      m.modulation.forward(ctx, std::exchange(again->tokens, {}), again->cameras, &saved.modulation);
    }
    dtokens = m.modulation.backward(ctx, std::exchange(saved.modulation, {}), dfeatures);
  }
  const Stage stage(ctx, "encoder");
  if (again) m.encoder.forward(ctx, again->images, &saved.encoder);
  m.encoder.backward(ctx, std::exchange(saved.encoder, {}), dtokens);
}

}  // namespace vsplat
