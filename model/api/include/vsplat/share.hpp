// Distributes work over devices for C++, see vsplat/share.h. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_SHARE_HPP
#define VSPLAT_SHARE_HPP

#include <exception>
#include <map>
#include <mutex>
#include <vsplat/vsplat.hpp>

namespace vsplat {
inline namespace cxx {
namespace detail {

// Carries exceptions of callbacks across the C interface.
class Thrown {
 public:
  template <class F>
  vsplat_status hold(size_t item, const F& run) {
    vsplat_status status = VSPLAT_ERROR_INTERNAL;
    try {
      run();
      forget(item);
      return VSPLAT_OK;
    } catch (const Error& e) {
      if (e.status() != VSPLAT_OK) status = e.status();
      keep(item, status);
    } catch (...) {
      keep(item, status);
    }
    return status;
  }
  // Rethrows that of the first item with this status.
  void rethrow(vsplat_status status) const {
    for (const auto& each : all_)
      if (each.first.second == static_cast<int>(status)) std::rethrow_exception(each.second);
  }

 private:
  // Drops the exceptions of an item that another device failed at and this one has done.
  void forget(size_t item) {
    const std::lock_guard<std::mutex> lock(mutex_);
    all_.erase(all_.lower_bound({item, 0}), all_.lower_bound({item + 1, 0}));
  }
  void keep(size_t item, vsplat_status status) {
    const std::lock_guard<std::mutex> lock(mutex_);
    all_[{item, static_cast<int>(status)}] = std::current_exception();
  }

  std::mutex mutex_;
  std::map<std::pair<size_t, int>, std::exception_ptr> all_;
};

template <class Work, class Done>
struct Sharing {
  const std::vector<Device>& devices;
  const Work& work;
  const Done& done;
  Thrown thrown;

  static vsplat_status on_work(void* user, vsplat_device, size_t index, size_t item) {
    auto* self = static_cast<Sharing*>(user);
    return self->thrown.hold(item, [&] { self->work(self->devices[index], item); });
  }
  static vsplat_status on_done(void* user, size_t item) {
    auto* self = static_cast<Sharing*>(user);
    return self->thrown.hold(item, [&] { self->done(item); });
  }
};

}  // namespace detail

// Calls `work(device, item)` for each item, and `done(item)` in order. An exception ends the whole and is rethrown by
// this call, except a device's Error, whose item another device does.
template <class Work, class Done>
void share_out(const std::vector<Device>& devices, size_t count, const Work& work, const Done& done, size_t ahead = 0) {
  detail::Sharing<Work, Done> shared{devices, work, done, {}};
  std::vector<vsplat_device> handles;
  handles.reserve(devices.size());
  for (const Device& device : devices) handles.push_back(device.get());
  vsplat_share_options options = VSPLAT_SHARE_OPTIONS_INIT;
  options.ahead = ahead;
  options.on_done = shared.on_done;
  options.user = &shared;
  const vsplat_status status = vsplat_share_out(handles.data(), handles.size(), count, shared.on_work, &options);
  shared.thrown.rethrow(status);
  check(status);
}

}  // namespace cxx
}  // namespace vsplat

#endif
