// Distributing work over devices.
#include "model/api/share.h"

#include <fmt/format.h>

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/share_out.h"

using namespace vsplat;
using namespace vsplat::api;

std::vector<vsplat_device> vsplat::api::sharing_devices(const vsplat_device* devices, std::size_t count,
                                                        const char* what) {
  need_array(devices, count, what);
  if (count == 0) fail(Status::usage, "{} has no device", what);
  std::vector<vsplat_device> out(devices, devices + count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!out[i]) fail(Status::usage, "{}[{}] is null", what, i);
    Holding::hold(out[i]);
    for (std::size_t j = 0; j < i; ++j)
      if (out[i] == out[j])
        fail(Status::usage, "{0}[{1}] and {0}[{2}] are the same handle: a stream (vsplat_stream_create) is another",
             what, j, i);
  }
  return out;
}

std::vector<vsplat_device> vsplat::api::with_more(vsplat_device device, const vsplat_device* more, std::size_t count,
                                                  Option what) {
  std::vector<vsplat_device> out{device};
  if (count == 0) return out;
  for (vsplat_device each : sharing_devices(more, count, option_name(what).c_str())) out.push_back(each);
  return sharing_devices(out.data(), out.size(), fmt::format("device and {}", what).c_str());
}

std::string vsplat::api::device_text(const std::vector<vsplat_device>& devices, std::size_t index) {
  return fmt::format("device {} ({})", devices[index]->context.device().index, devices[index]->context.device().name);
}

void vsplat::api::warn_of_loss(const std::vector<vsplat_device>& devices, std::size_t index, const Error& error) {
  warn("{} gets no more work, the others go on: {}", device_text(devices, index), error.what());
}

vsplat_status vsplat_share_out(const vsplat_device* devices, size_t num_devices, size_t count,
                               vsplat_share_function work, const vsplat_share_options* options) {
  return guarded([&] {
    const std::vector<vsplat_device> all = sharing_devices(devices, num_devices, "devices");
    if (!work) fail(Status::usage, "work is null");
    const vsplat_share_options o = taken(options, VSPLAT_SHARE_OPTIONS_INIT, "options");
    refuse_after_fork();
    // A caller's function may return a number that is no value of the enum, so it is read as a number first.
    const auto hold = [](const vsplat_status& returned, const char* by) {
      const int status = value_of(returned);
      if (status == VSPLAT_OK) return;
      if (status < VSPLAT_OK || status > VSPLAT_ERROR_BUSY)
        fail(Status::usage, "{} returned {}, which is no vsplat_status", by, status);
      const char* why = vsplat_last_error();
      throw Error(static_cast<Status>(status),
                  *why ? why : fmt::format("{} ended it: {}", by, vsplat_status_name(returned)));
    };
    ShareOut shared;
    shared.items = count;
    shared.workers = all.size();
    shared.ahead = o.ahead ? o.ahead : 8 * all.size();
    shared.work = [&](std::size_t worker, std::size_t item) {
      set_last_error("");
      hold(work(o.user, all[worker], worker, item), "the function of the work");
    };
    if (o.on_done)
      shared.done = [&](std::size_t item) {
        set_last_error("");
        hold(o.on_done(o.user, item), "on_done");
      };
    shared.lost = [&](std::size_t worker, std::size_t item, const Error& error) {
      warn_of_loss(all, worker, error);
      if (o.on_lost) o.on_lost(o.user, worker, item, error.what());
    };
    share_out(shared);
  });
}
