#pragma once
#include <atomic>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/api/handle.h"
#include "model/api/job_queue.h"
#include "model/api/residents.h"
#include "model/base/scene.h"
#include "model/render/gaussian_chunks.h"
#include "runtime/context.h"

struct vsplat_device_impl : vsplat::api::Counted {
  // Wraps an opened device, or a stream of one.
  explicit vsplat_device_impl(std::unique_ptr<vsplat::Context> opened)
      : own(std::move(opened)), context(*own), residents(std::make_shared<vsplat::api::Residents>()) {}
  explicit vsplat_device_impl(const vsplat_device_impl& other)
      : own(other.context.stream()), context(*own), residents(other.residents) {}

  const std::unique_ptr<vsplat::Context> own;
  vsplat::Context& context;
  std::atomic_flag in_use = ATOMIC_FLAG_INIT;  // by a call or by jobs: see DeviceUse

  // What the last calls put on the device, cached for the next ones while the host objects live; filled in
  // residents.cpp and drawing.cpp. Declared after the context, so that it is destroyed first.
  const std::shared_ptr<vsplat::api::Residents> residents;
  std::weak_ptr<const vsplat::Scene> scene_key;
  std::optional<vsplat::GaussianChunks> scene;

  std::vector<std::pair<std::string, std::string>> profile_names;  // subject of profiles
  std::size_t peak_before = 0;  // bytes of device memory, before the latest fit began

  vsplat::api::JobQueue jobs;  // last member: its thread ends before anything that it uses is destroyed
};

namespace vsplat::api {

// Holds a device for a call until the call ends. Error(usage) if it is null, Error(busy) if another call holds it,
// Error(device) in a child of fork(). On the device's job thread the jobs hold it already, and this borrows it.
class DeviceUse {
 public:
  explicit DeviceUse(vsplat_device device);
  ~DeviceUse();
  DeviceUse(const DeviceUse&) = delete;
  DeviceUse& operator=(const DeviceUse&) = delete;

 private:
  vsplat_device device_;
  bool of_job_;
};

// Context options for the options of vsplat_device_open.
ContextOptions context_options(const vsplat_device_options* options);

// Runs `run`, which needs much memory. If it throws Error(memory), drops the weights of idle models except `but` and
// the scene drawn last, and runs it once more if that freed anything. `run` must have no visible effects before it
// throws.
template <class F>
auto retry_with_memory_freed(vsplat_device device, vsplat_model but, const F& run) {
  try {
    return run();
  } catch (const Error& e) {
    if (e.status() != Status::memory) throw;
    const bool drawn = device->scene.has_value();
    device->scene.reset();
    device->scene_key.reset();
    if (!device->residents->drop_idle(but) && !drawn) throw;
  }
  device->context.memory().trim();
  return run();
}

}  // namespace vsplat::api
