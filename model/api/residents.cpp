#include "model/api/residents.h"

#include <algorithm>

#include "runtime/fail.h"

namespace vsplat::api {
namespace {

std::shared_ptr<const Network> uploaded(Context& ctx, vsplat_model model) {
  const Stage stage(ctx, "encoder");  // the position embedding is resampled on the device
  std::shared_ptr<const Network> out = make_network(ctx, config_of(model), weights_of(model));
  ctx.finish();  // other streams may read it from now on
  return out;
}

}  // namespace

std::shared_ptr<const Network> Residents::network(Context& ctx, vsplat_model model) {
  const std::lock_guard lock(mutex_);
  for (const Resident& there : all_)
    if (there.model.lock() == model->file) return there.network;
  std::erase_if(all_, [](const Resident& there) { return there.model.expired() && there.network.use_count() == 1; });
  std::shared_ptr<const Network> made;
  try {
    made = uploaded(ctx, model);
  } catch (const Error& e) {
    if (e.status() != Status::memory || !drop(nullptr)) throw;
    ctx.memory().trim();
    made = uploaded(ctx, model);
  }
  all_.push_back({model->file, made});
  return made;
}

bool Residents::drop_idle(vsplat_model but) {
  const std::lock_guard lock(mutex_);
  return drop(but ? but->file.get() : nullptr);
}

bool Residents::drop(const AnyModel* but) {
  return std::erase_if(all_, [&](const Resident& there) {
           return there.network.use_count() == 1 && (!but || there.model.lock().get() != but);
         }) > 0;
}

}  // namespace vsplat::api
