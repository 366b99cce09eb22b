#include "model/networks/vsplat/voxel_selection.h"

#include "model/ops/volume/compact.h"
#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

// Index of this stream among the seed's random streams.
constexpr std::uint32_t kSelectionStream = 1;

Tensor upload_forced(Context& ctx, const std::vector<int>& forced, long voxels) {
  for (std::size_t i = 0; i < forced.size(); ++i) {
    if (forced[i] < 0 || forced[i] >= voxels) {
      fail(Status::input, "selection: voxel {} does not exist, the volume has {}", forced[i], voxels);
    }
    if (i > 0 && forced[i] <= forced[i - 1]) {
      fail(Status::input, "selection: voxel {} follows {}; the list must ascend", forced[i], forced[i - 1]);
    }
  }
  return ctx.upload({static_cast<long>(forced.size())}, forced, Type::i32, "selection.index");
}

}  // namespace

SelectedVoxels select_voxels(Context& ctx, const Config& config, const Tensor& logits, const Tensor& opacities,
                             const SelectionOptions& options, SelectionSaved* saved) {
  const Stage stage(ctx, "selection");
  const long voxels = config.voxels();
  SelectForward f;
  f.logits = logits;
  f.opacities = opacities;
  f.selection = selection_of(config.selection);
  f.temperature = options.temperature;
  f.opacity_threshold = static_cast<float>(config.opacity_threshold);
  if (f.selection == Selection::gumbel) {
    f.noise = options.noise;
    if (!f.noise && options.seed) {
      f.noise = ctx.tensor({voxels}, Type::f32, "selection.noise");
      logistic_noise(ctx, f.noise, *options.seed, 0, kSelectionStream);
    }
  }
  f.factor = ctx.tensor({voxels}, Type::f32, "selection.factor");
  f.refined = ctx.tensor({voxels}, Type::f32, "selection.opacities");
  f.flags = ctx.tensor({voxels}, Type::u32, "selection.flags");
  select_forward(ctx, f);
  if (saved) *saved = {f.logits, f.noise, f.opacities, f.selection, f.temperature};
  const Tensor index =
      options.forced ? upload_forced(ctx, *options.forced, voxels) : compact(ctx, f.flags, options.planned);
  return {f.factor, f.refined, index, index.dim(0)};
}

Tensor select_voxels_backward(Context& ctx, const SelectionSaved& saved, const Tensor& dopacities) {
  const Stage stage(ctx, "selection");
  SelectBackward b;
  b.logits = saved.logits;
  b.noise = saved.noise;
  b.opacities = saved.opacities;
  b.selection = saved.selection;
  b.temperature = saved.temperature;
  b.drefined = b.dopacities = dopacities;
  if (b.selection != Selection::opacity) b.dlogits = ctx.tensor(saved.logits.shape(), Type::f32, "logits gradient");
  select_backward(ctx, b);
  return b.dlogits;
}

}  // namespace vsplat
