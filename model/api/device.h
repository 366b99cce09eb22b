#pragma once
#include <atomic>
#include <memory>
#include <optional>

#include "model/api/handle.h"
#include "model/base/gaussians.h"
#include "model/base/scene.h"
#include "model/params/systems.h"
#include "model/splat/gaussian_chunks.h"
#include "model/systems/network.h"
#include "runtime/context.h"

struct vsplat_device_impl : vsplat::api::Counted {
  explicit vsplat_device_impl(const vsplat::ContextOptions& options) : context(options) {}

  vsplat::Context context;
  std::atomic_flag in_use = ATOMIC_FLAG_INIT;  // by a call: see DeviceUse

  // What the last calls put on the device stays for the next ones, while its host side is there: see where they are
  // filled. After the context, so that they go first.
  std::weak_ptr<const vsplat::AnyModel> network_key;
  std::unique_ptr<vsplat::Network> network;
  std::weak_ptr<const vsplat::Scene> scene_key;
  std::optional<vsplat::GaussianChunks> scene;
};

namespace vsplat::api {

// A call's hold of a device, until the call ends. Error(usage) where there is none, Error(busy) where another call has
// it, Error(device) in a child of fork().
class DeviceUse {
 public:
  explicit DeviceUse(vsplat_device device);
  ~DeviceUse() { device_->in_use.clear(std::memory_order_release); }
  DeviceUse(const DeviceUse&) = delete;
  DeviceUse& operator=(const DeviceUse&) = delete;

 private:
  vsplat_device device_;
};

}  // namespace vsplat::api
