// What is behind a fit's scene, and what its masks leave out.
#include <algorithm>

#include "model/fit/scene_fit_impl.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr std::size_t kMasksSampled = 8;  // masks sampled to represent all

}  // namespace

// Counts masks, chooses the background of a whole scene that has none, refuses what masks make impossible, and warns if
// little of the pictures takes part.
void SceneFit::Impl::check_masks() {
  const bool ignored = photographs.masks == MaskUse::ignore;
  std::size_t listed = 0;
  for (const int view : used) {
    if (photographs.set.views[static_cast<std::size_t>(view)].mask) ++listed;
    if (LoadedPhotograph(photographs, view).is_masked()) ++masked;
  }
  if (listed == 0 && (ignored || photographs.invert_masks))
    fail(Status::usage, "{}: none of the {} pictures has a mask", ignored ? Option::masks : Option::invert_masks,
         used.size());
  // A fixed colour would take the place of Gaussians where few pictures look (bench/results/README.md).
  if (request.whole && request.background.kind == FitBackground::Kind::automatic)
    request.background.kind = masked > 0 ? FitBackground::Kind::random : FitBackground::Kind::sky;
  if (masked > 0 && request.background.kind == FitBackground::Kind::sky)
    fail(Status::usage,
         "{} is sky: {} of the {} pictures have a mask or alpha that marks an object, and show no sky around it. Masks "
         "may be ignored outside instead ({}), or another background be given",
         Option::background, masked, used.size(), Option::masks);
  if (!ignored) return;
  double share = 0;
  const std::size_t n = std::min(used.size(), kMasksSampled);
  for (std::size_t i = 0; i < n; ++i)
    share += known_share(*pictures.at(used[i * used.size() / n])) / static_cast<double>(n);
  if (share < 0.5)
    warn(
        "only {:.0f} % of what the pictures show is white in their masks and takes part in the fit; {} exchanges black "
        "and white",
        100 * share, Option::invert_masks);
}

// About the cameras' mean, far outside of what they see.
SkySphere SceneFit::Impl::sky_sphere() const {
  SkySphere out;
  for (const int view : used) {
    const Eigen::Vector3d at = to_world.inverse().apply(resolved_view(photographs, view).camera.centre());
    for (Eigen::Index i = 0; i < 3; ++i)
      out.centre[static_cast<std::size_t>(i)] += at[i] / static_cast<double>(used.size());
  }
  return out;
}

FitScore SceneFit::Impl::score_written() {
  Measured sum;
  with_each(phases[phase].held_out, [&](int view) {
    const FitScore score = fitter->score(*best, on_device(view));
    sum.psnr += score.psnr;
    sum.ssim += score.ssim;
    ++sum.pictures;
  });
  return mean(sum);
}

}  // namespace vsplat
