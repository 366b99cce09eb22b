// The report of a machine, from the results of other calls.
#include <fmt/chrono.h>

#include <algorithm>
#include <chrono>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "model/api/handle.h"
#include "model/diagnose/doctor.h"
#include "model/diagnose/personal.h"
#include "model/diagnose/system_facts.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

using Json = nlohmann::ordered_json;

std::string day() {
  return fmt::format("{:%Y-%m-%d}",
                     fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

Json info_json(vsplat_device device) {
  vsplat_device_info info = VSPLAT_DEVICE_INFO_INIT;
  if (vsplat_device_get_info(device, &info) != VSPLAT_OK) return {{"error", vsplat_last_error()}};
  return {{"index", info.index},
          {"name", info.name},
          {"vendor", info.vendor},
          {"driver", info.driver},
          {"version", info.version},
          {"platform_name", info.platform_name},
          {"memory", info.memory},
          {"max_alloc", info.max_alloc},
          {"local_memory", info.local_memory},
          {"max_work_group", info.max_work_group},
          {"compute_units", info.compute_units},
          {"event_profiling", info.event_profiling != 0},
          {"fp16", info.fp16 != 0},
          {"fp64", info.fp64 != 0},
          {"subgroups", info.subgroups != 0},
          {"kernels", info.kernels == VSPLAT_KERNELS_GPU ? "gpu" : "cpu"},
          {"tuning", info.tuning},
          {"limits", info.limits},
          {"switched_off", info.switched_off}};
}

// The JSON that a call returns as text. Throws Error if it fails.
template <class Call>
Json json_of_call(const Call& call) {
  char* text = nullptr;
  if (const vsplat_status status = call(&text); status != VSPLAT_OK)
    fail(static_cast<Status>(status), "{}", vsplat_last_error());
  const std::string out = text;
  vsplat_text_free(text);
  return Json::parse(out);
}

void hold(vsplat_status status) {
  if (status != VSPLAT_OK) fail(static_cast<Status>(status), "{}", vsplat_last_error());
}

struct Model {
  ~Model() { vsplat_model_release(handle); }
  vsplat_model handle = nullptr;
};

Json run_json(vsplat_device device, const vsplat_report_options& o) {
  Json out;
  vsplat_check_options options = VSPLAT_CHECK_OPTIONS_INIT;
  options.progress = o.progress;
  options.user = o.user;
  try {
    Model model;
    hold(vsplat_model_load(nullptr, &model.handle));
    hold(vsplat_device_profile(device, 1));
    out["check"] = json_of_call([&](char** text) { return vsplat_model_check(device, model.handle, &options, text); });
    hold(vsplat_device_profile(device, 0));
    out["profile"] =
        json_of_call([&](char** text) { return vsplat_device_profile_text(device, VSPLAT_PROFILE_JSON, text); });
  } catch (const Error& e) {
    if (e.status() == Status::cancelled || e.status() == Status::busy) throw;
    out["error"] = e.what();
  }
  return out;
}

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// Whether a field holds what people write or enter, rather than names that drivers and this program use.
bool may_name_people(const std::string& part, const std::string& field) {
  if (part == "environment") return true;
  if (part == "kept")
    return !is_one_of(field, {"date", "device", "driver", "flavour", "format", "hash", "kernels", "measured", "off",
                              "op", "platform", "refused", "verdict", "version", "worst"});
  return is_one_of(field, {"about", "doing", "entry", "error", "file", "found", "library", "looks_in", "mend", "path",
                           "place", "problem", "said", "variable"});
}

// `field` is the nearest name above a string.
void make_impersonal(Json& of, const Personal& who, const std::string& part, const std::string& field) {
  if (of.is_string())
    of = may_name_people(part, field) ? without_personal(of.get<std::string>(), who)
                                      : without_homes(of.get<std::string>(), who);
  if (of.is_array())
    for (Json& each : of) make_impersonal(each, who, part, field);
  if (of.is_object())
    for (auto& [name, each] : of.items()) make_impersonal(each, who, part.empty() ? name : part, name);
}

}  // namespace

vsplat_status vsplat_report(vsplat_device device, const vsplat_report_options* options, char** out_text) {
  return guarded([&] {
    need(out_text, "out_text");
    const vsplat_report_options o = taken(options, VSPLAT_REPORT_OPTIONS_INIT, "options");
    if (!(o.seconds > 0 && o.seconds <= 3600))
      fail(Status::usage, "options.seconds is {}: more than 0 and at most 3600 expected", o.seconds);
    // Runs first, because this call reports whether the device is in use, and examining the drivers takes a while.
    Json run = device ? run_json(device, o) : Json();
    Json out;
    out["format"] = "vsplat-report";
    out["version"] = vsplat_version_string();
    out["made"] = day();
    out["system"] = system_facts();
    out["environment"] = environment_facts();
    out["doctor"] = Json::parse(diagnosis_json(diagnose(o.seconds)));
    out["device"] = device ? info_json(device) : Json();
    out["run"] = std::move(run);
    out["kept"] = stored_facts();  // includes peaks that the run's profile has measured
    make_impersonal(out, personal_here(), "", "");
    *out_text = new_text(out.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
  });
}
