// Profiles of a device and of the host's work around it.
#include <algorithm>

#include "model/api/device.h"
#include "runtime/clock.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/profile/peaks.h"
#include "runtime/profile/profile_page.h"
#include "runtime/profile/profiler.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

constexpr double kLongestAgo = 1e9;  // seconds

// The device's peak rates; none if they cannot be measured.
std::optional<Peaks> peaks_if_any(Context& ctx, const Profile& profile) {
  try {
    return peaks_of(ctx, gflops_seen(profile));
  } catch (const Error& e) {
    warn("the profile has no shares of the device's peak rates: {}", e.what());
    return std::nullopt;
  }
}

}  // namespace

vsplat_status vsplat_profile_begin(double seconds_ago) {
  return guarded([&] {
    if (!(seconds_ago >= 0 && seconds_ago <= kLongestAgo))
      fail(Status::usage, "seconds_ago is {}: 0 to {} expected", seconds_ago, kLongestAgo);
    const std::uint64_t now = now_ns(), ago = static_cast<std::uint64_t>(seconds_ago * 1e9);
    HostLog::of_process().begin(ago < now ? now - ago : 1);
  });
}

vsplat_status vsplat_device_profile(vsplat_device device, int32_t on) {
  return guarded([&] {
    const DeviceUse use(device);
    device->context.finish();
    Profiler& profiler = device->context.profiler();
    if (on && !profiler.enabled()) profiler.reset();
    profiler.enable(on != 0);
  });
}

vsplat_status vsplat_device_profile_name(vsplat_device device, const char* what, const char* name) {
  return guarded([&] {
    const DeviceUse use(device);
    need(what, "what");
    need(name, "name");
    auto& names = device->profile_names;
    std::erase_if(names, [&](const auto& there) { return there.first == what; });
    names.emplace_back(what, name);
  });
}

vsplat_status vsplat_device_profile_text(vsplat_device device, vsplat_profile_format format, char** out_text) {
  return guarded([&] {
    const DeviceUse use(device);
    need(out_text, "out_text");
    Context& ctx = device->context;
    ctx.finish();
    const Profile profile = ctx.profiler().profile();
    const auto subject = [&]() -> ProfileSubject {
      return {ctx.device().name,     ctx.device().driver,        std::max(device->peak_before, ctx.memory().peak()),
              device->profile_names, peaks_if_any(ctx, profile), ctx.tuning().hash(),
              ctx.precision()};
    };
    switch (value_of(format)) {
      case VSPLAT_PROFILE_JSON:
        *out_text = new_text(profile_json(profile, subject()));
        return;
      case VSPLAT_PROFILE_PAGE:
        *out_text = new_text(profile_page(profile, subject()));
        return;
      case VSPLAT_PROFILE_TRACE:
        *out_text = new_text(profile_trace(profile));
        return;
      case VSPLAT_PROFILE_TABLE:
        *out_text = new_text(profile_table(profile, known_peaks(ctx)));
        return;
    }
    fail(Status::usage, "format is {}, not a value of vsplat_profile_format", value_of(format));
  });
}

vsplat_status vsplat_device_profile_count(vsplat_device device, size_t* out_count) {
  return guarded([&] {
    const DeviceUse use(device);
    need(out_count, "out_count");
    device->context.finish();
    *out_count = device->context.profiler().rows().size();
  });
}

vsplat_status vsplat_device_profile_get(vsplat_device device, size_t index, vsplat_profile_row* out_row) {
  return guarded([&] {
    const DeviceUse use(device);
    require_output(out_row, "out_row");
    device->context.finish();
    const std::vector<ProfileRow> rows = device->context.profiler().rows();
    if (index >= rows.size()) fail(Status::usage, "index is {}: there are {} rows", index, rows.size());
    const ProfileRow& row = rows[index];
    const auto seconds = [](std::uint64_t ns) { return static_cast<double>(ns) * 1e-9; };
    vsplat_profile_row out = VSPLAT_PROFILE_ROW_INIT;
    row.name.copy(out.kernel, sizeof out.kernel - 1);
    row.stage.copy(out.stage, sizeof out.stage - 1);
    out.calls = row.calls;
    out.seconds = seconds(row.total_ns);
    out.least = seconds(row.min_ns), out.most = seconds(row.max_ns);
    out.queued = seconds(row.queued_ns + row.submitted_ns);
    out.first_calls = row.first_calls, out.first_seconds = seconds(row.first_ns);
    out.flops = row.flops, out.bytes = row.bytes, out.performed_flops = row.performed_flops;
    out.timed_on_host = std::string(row.timed_by) == "host";
    give(out_row, out, "out_row");
  });
}
