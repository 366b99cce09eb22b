#include "model/reconstruct/passes.h"

#include <algorithm>

#include "model/base/merged_gaussians.h"
#include "model/base/scene.h"
#include "model/base/scene_edit.h"
#include "model/views/placement.h"

namespace vsplat {

namespace {

// The same values with those of view `first` in front: those before it come last.
std::vector<float> from_view(const std::vector<float>& pictures, std::size_t views, std::size_t first) {
  std::vector<float> out = pictures;
  std::rotate(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(out.size() / views * first), out.end());
  return out;
}

// Merged Gaussians fainter than this are left out: most of them are fog about the object, and a twelfth of all.
constexpr float kFaint = 0.02f;

// The mean of the passes, merged.
Gaussians joined(const std::vector<Gaussians>& passes, double cell) {
  Gaussians out = mean_of(passes);
  if (cell <= 0 || out.kind != GaussianKind::volume) return out;
  out = merged_in_cells(out, cell);
  keep(out, [&out](std::size_t k) { return out.opacities[k] >= kFaint; });
  return out;
}

}  // namespace

Passes forward_passes(Context& ctx, const Network& network, const std::vector<float>& pictures,
                      const std::vector<Camera>& cameras, const PassOptions& passes, const ForwardOptions& options) {
  const TakenViews taken = network.config().taken();
  const std::size_t views = cameras.size();
  const std::size_t count = std::clamp<std::size_t>(static_cast<std::size_t>(passes.count), 1, views);
  const Shape shape{static_cast<long>(views), taken.image, taken.image, 3};
  ForwardOptions forward = options;
  std::size_t done = 0;
  if (options.progress)
    forward.progress = [&](const std::string& stage, double share) {
      options.progress(stage, (static_cast<double>(done) + share) / static_cast<double>(count));
    };
  Passes out;
  std::vector<Gaussians> coarse, final;
  for (; done < count; ++done) {
    const std::size_t first = done * views / count;
    PlacedViews placed{cameras, {}};
    if (first > 0) {
      std::rotate(placed.cameras.begin(), placed.cameras.begin() + static_cast<std::ptrdiff_t>(first),
                  placed.cameras.end());
      placed = place_views(placed.cameras, {}, taken.rebase);
    }
    const Tensor input = ctx.upload(shape, from_view(pictures, views, first), Type::f32, "pictures");
    Network::Result made = network.forward(ctx, input, placed.cameras, forward);
    final.push_back(download(ctx, made.final));
    if (passes.coarse) coarse.push_back(download(ctx, made.coarse));
    if (first > 0) {
      transform(final.back(), placed.to_world);
      if (passes.coarse) transform(coarse.back(), placed.to_world);
    }
    made.coarse = made.final = {};
    if (first == 0) out.first = std::move(made);
  }
  const double cell = passes.merge_cell / taken.cells;
  out.final = joined(final, cell);
  if (passes.coarse) out.coarse = joined(coarse, cell);
  return out;
}

}  // namespace vsplat
