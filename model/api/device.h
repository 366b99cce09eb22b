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
  // A device that was opened, or a stream of one.
  explicit vsplat_device_impl(std::unique_ptr<vsplat::Context> opened)
      : own(std::move(opened)), context(*own), residents(std::make_shared<vsplat::api::Residents>()) {}
  explicit vsplat_device_impl(const vsplat_device_impl& other)
      : own(other.context.stream()), context(*own), residents(other.residents) {}

  const std::unique_ptr<vsplat::Context> own;
  vsplat::Context& context;
  std::atomic_flag in_use = ATOMIC_FLAG_INIT;  // by a call, or by jobs: see DeviceUse

  // What the last calls put on the device stays for the next ones, while its host side is there: see where it is
  // filled. After the context, so that it goes first.
  const std::shared_ptr<vsplat::api::Residents> residents;
  std::weak_ptr<const vsplat::Scene> scene_key;
  std::optional<vsplat::GaussianChunks> scene;

  std::vector<std::pair<std::string, std::string>> profile_names;  // what profiles are of

  vsplat::api::JobQueue jobs;  // last: its thread ends before anything goes that it uses
};

namespace vsplat::api {

// A call's hold of a device, until the call ends. Error(usage) where there is none, Error(busy) where another call has
// it, Error(device) in a child of fork(). On the thread of the device's jobs, the job's: these have the device.
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

// What vsplat_device_open makes of its options.
ContextOptions context_options(const vsplat_device_options* options);

// Runs what needs much memory; once more without the networks of models but that one and what was drawn, where it
// refuses for want of memory and there are any. It may not have told anyone anything before that.
template <class F>
auto with_room(vsplat_device device, vsplat_model but, const F& run) {
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
