// One step of a fit: which picture it takes, and what is learnt from it.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "model/base/rng.h"
#include "model/fit/scene_fit_impl.h"
#include "runtime/clock.h"

namespace vsplat {
namespace {

constexpr double kPoseRate = 3e-4, kExposureRate = 2e-3;  // Adam learning rates, decaying to a tenth over a phase

}  // namespace

// Drawings may have taken the memory that a decoder reserves. They need it no longer, and are then drawn in more parts.
std::shared_ptr<const FitPicture> SceneFit::Impl::read_picture(int view) {
  try {
    return pictures.at(view);
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
  }
  pictures.read_ahead({});
  ctx.memory().trim();
  return pictures.at(view);
}

// Starts to decode the pictures that come next, but for those on the device.
void SceneFit::Impl::read_ahead(std::vector<int> views) {
  std::erase_if(views, [this](int view) { return resident.count(view) > 0; });
  pictures.read_ahead(views);
}

void SceneFit::Impl::with_each(const std::vector<int>& views, const std::function<void(int view)>& use) {
  for (auto view = views.begin(); view != views.end(); ++view) {
    read_ahead({view, views.end()});
    use(*view);
  }
}

void SceneFit::Impl::read_ahead_of_steps() {
  const std::vector<int>& views = phases[phase].views;
  if (std::all_of(views.begin(), views.end(), [this](int view) { return resident.count(view) > 0; })) return;
  std::vector<int> next;
  const long first = fitter->steps_done() + 1;
  const long end = std::min(first + static_cast<long>(pictures.most_ahead()), phase_steps);
  for (long step = first; step < end; ++step) next.push_back(view_of_step(step));
  read_ahead(next);
}

const DeviceFitPicture& SceneFit::Impl::on_device(int view) {
  const auto there = resident.find(view);
  if (there != resident.end()) return there->second;
  const auto begun = now_ns();
  const std::shared_ptr<const FitPicture> picture = read_picture(view);
  waited += 1e-9 * static_cast<double>(now_ns() - begun);
  ++reads;
  const std::size_t bytes = bytes_of(*picture);
  if (resident_bytes + bytes > budget.on_device) {
    passing = {};
    passing = upload(ctx, *picture);
    return passing;
  }
  DeviceFitPicture& out = resident.emplace(view, upload(ctx, *picture)).first->second;
  resident_bytes += bytes;
  if (!in_folds()) pictures.forget(view);
  return out;
}

// The camera of the view's picture, with its learnt correction. Decodes the picture only if it never was.
Camera SceneFit::Impl::corrected_camera(int view) {
  Camera out = pictures.camera(view);
  if (const auto pose = poses.find(view); pose != poses.end()) out.w2c = pose->second.w2c();
  return out;
}

// The picture on the device, with the corrected camera.
DeviceFitPicture SceneFit::Impl::corrected(int view) {
  DeviceFitPicture out = on_device(view);
  out.camera = corrected_camera(view);
  return out;
}

// One step of the scene, and of the view's pose and exposure corrections.
void SceneFit::Impl::step_on(int view, const DeviceFitPicture& picture) {
  const double fall = std::pow(0.1, static_cast<double>(fitter->steps_done()) / static_cast<double>(phase_steps));
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
  const std::vector<int>& views = phases[phase].views;
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
