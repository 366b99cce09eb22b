// One step of a fit: which picture it takes, at which size, and what is learnt from it.
#include <array>
#include <cmath>
#include <memory>

#include "model/base/rng.h"
#include "model/fit/scene_fit_impl.h"

namespace vsplat {
namespace {

constexpr double kPoseRate = 3e-4, kExposureRate = 2e-3;  // Adam learning rates, decaying to a tenth over a phase

}  // namespace

// The factor by which pictures are reduced: coarse first, then fine.
int SceneFit::Impl::reduction_after(long step) const {
  return step < recipe.half_from ? 4 : step < recipe.full_from ? 2 : 1;
}

const DeviceFitPicture& SceneFit::Impl::on_device(int view, int reduction) {
  const auto there = resident.find({view, reduction});
  if (there != resident.end()) return there->second;
  std::shared_ptr<const FitPicture> picture = pictures.at(view);
  if (reduction > 1) picture = std::make_shared<const FitPicture>(reduced(*picture, reduction));
  const std::size_t bytes = picture->rgba.size() + picture->known.size();
  if (resident_bytes + bytes > spare_bytes / 2) {
    passing = {};
    passing = upload(ctx, *picture);
    return passing;
  }
  DeviceFitPicture& out = resident.emplace(std::pair(view, reduction), upload(ctx, *picture)).first->second;
  resident_bytes += bytes;
  if (!in_folds() && reduction == 1) pictures.forget(view);
  return out;
}

// The picture on the device, with its learnt pose correction.
DeviceFitPicture SceneFit::Impl::corrected(int view, int reduction) {
  DeviceFitPicture out = on_device(view, reduction);
  if (const auto pose = poses.find(view); pose != poses.end()) out.camera.w2c = pose->second.w2c();
  return out;
}

// Frees the reduced pictures.
void SceneFit::Impl::drop_reduced() {
  for (auto each = resident.begin(); each != resident.end();) {
    if (each->first.second > 1) {
      resident_bytes -= each->second.given.bytes() + (each->second.known ? each->second.known.bytes() : 0);
      each = resident.erase(each);
    } else {
      ++each;
    }
  }
}

// One step of the scene, and of the view's pose and exposure corrections.
void SceneFit::Impl::step_on(int view) {
  const long done = fitter->steps_done();
  const int reduction = reduction_after(done);
  if (done > 0 && reduction < reduction_after(done - 1)) drop_reduced();
  const DeviceFitPicture picture = corrected(view, reduction);
  const double fall = std::pow(0.1, static_cast<double>(fitter->steps_done()) / static_cast<double>(leg_steps));
  std::array<double, 6> dpose{};
  FitAside aside;
  if (request.poses) aside.dpose = &dpose;
  if (request.exposure) {
    const ExposureCorrection& exposure = exposures.try_emplace(view, make_exposure(ctx)).first->second;
    aside.exposure = exposure.map.reshaped({12});
    aside.dexposure = exposure.gradient.reshaped({12});
  }
  fitter->differentiate(picture, aside);
  const Uncancelled whole(ctx);
  fitter->move();
  if (request.poses) poses.try_emplace(view, picture.camera.w2c).first->second.move(dpose, kPoseRate * fall);
  if (request.exposure) move(ctx, exposures.at(view), kExposureRate * fall);
}

// Each epoch visits every view once, in its own random order.
int SceneFit::Impl::view_of_step(long step) const {
  const std::vector<int>& views = legs[leg].views;
  const auto n = static_cast<long>(views.size());
  const auto epoch = static_cast<std::uint32_t>(step / n);
  std::vector<int> order = views;
  for (std::size_t i = order.size() - 1; i > 0; --i) {
    const auto random =
        philox4x32_10({static_cast<std::uint32_t>(i), epoch, stream_of("fit.order"), 0}, rng_key(request.seed));
    std::swap(order[i], order[random[0] % (i + 1)]);
  }
  return order[static_cast<std::size_t>(step % n)];
}

}  // namespace vsplat
