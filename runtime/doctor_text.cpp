// Reports of the examined facts and findings.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "runtime/doctor.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

using Json = nlohmann::ordered_json;
using State = SeenDriver::State;

const char* name_of(State state) {
  switch (state) {
    case State::loaded:
      return "loaded";
    case State::not_loaded:
      return "not_loaded";
    case State::no_driver:
      return "no_driver";
    case State::crashed:
      return "crashed";
    case State::too_late:
      return "hangs";
  }
  return "";
}

std::string where(const DriverEntries& entries) {
  return entries.variable.empty() ? entries.place : fmt::format("{}={}", entries.variable, printable(entries.place));
}

std::string state_text(const LookedDriver& driver) {
  const SeenDriver& seen = driver.seen;
  if (!driver.entry.problem.empty()) return driver.entry.problem;
  switch (seen.state) {
    case State::not_loaded:
      return "cannot be loaded";
    case State::no_driver:
      return "is no OpenCL driver";
    case State::crashed:
      return "crashes " + seen.doing;
    case State::too_late:
      return "hangs " + seen.doing;
    case State::loaded:
      break;
  }
  std::string out;
  for (const SeenPlatform& platform : seen.platforms) out += (out.empty() ? "" : ", ") + platform.name;
  if (out.empty()) return "gives no platform";
  const std::size_t count = seen.devices();
  return out + (count == 0 ? ", no device" : count == 1 ? ", 1 device" : fmt::format(", {} devices", count));
}

Json device_json(const SeenDevice& device) {
  return {{"type", device.type},
          {"name", device.name},
          {"vendor", device.vendor},
          {"driver", device.driver},
          {"memory", device.memory}};
}

Json text_or_null(const std::string& text) { return text.empty() ? Json() : Json(text); }

Json driver_json(const LookedDriver& driver) {
  Json out;
  out["entry"] = text_or_null(driver.entry.file);
  out["library"] = text_or_null(driver.entry.library);
  out["state"] = driver.entry.problem.empty() ? name_of(driver.seen.state) : "no_library";
  out["path"] = text_or_null(driver.seen.path);
  out["error"] = text_or_null(driver.entry.problem.empty() ? driver.seen.error : driver.entry.problem);
  out["doing"] = text_or_null(driver.seen.doing);
  out["said"] = text_or_null(driver.seen.said);
  out["platforms"] = Json::array();
  for (const SeenPlatform& platform : driver.seen.platforms) {
    Json& one = out["platforms"].emplace_back(
        Json{{"name", platform.name}, {"version", platform.version}, {"devices", Json::array()}});
    for (const SeenDevice& device : platform.devices) one["devices"].push_back(device_json(device));
  }
  return out;
}

Json file_json(const DeviceFile& file) { return {{"path", file.path}, {"problem", text_or_null(file.problem)}}; }

}  // namespace

std::string diagnosis_text(const Diagnosis& diagnosis) {
  const Looked& looked = diagnosis.looked;
  std::string out = fmt::format("loader   {}{}, which looks in {}\n", looked.loader.path,
                                looked.loader.ocl_icd ? " (ocl-icd)" : "", where(looked.entries));
  for (const LookedDriver& driver : looked.drivers)
    out += fmt::format("driver   {}{}: {}\n", driver.entry.file.empty() ? "" : driver.entry.file + ": ",
                       printable(driver.entry.library), state_text(driver));
  for (const LookedDevice& device : looked.devices)
    out += fmt::format("device   {}  {}:{}  {}  {} ({}, {})\n", device.index, device.platform, device.device,
                       device.seen.type, device.seen.name, device.platform_name, device.seen.driver);
  if (looked.devices.empty()) out += "device   none\n";
  for (const auto* all : {&looked.files.nvidia, &looked.files.amd, &looked.files.render})
    for (const DeviceFile& file : *all)
      out += fmt::format("file     {}: {}\n", file.path, file.problem.empty() ? "can be opened" : file.problem);
  for (const Cache& cache : looked.caches)
    out += fmt::format("cache    {} of {}: {}\n", cache.folder.path, cache.of,
                       cache.writable ? "can be written" : "cannot be written");
  const std::size_t count = diagnosis.findings.size();
  if (count == 0) return out + "\nNothing is wrong.\n";
  out += count == 1 ? "\n1 thing is wrong:\n" : fmt::format("\n{} things are wrong:\n", count);
  for (std::size_t i = 0; i < count; ++i)
    out += fmt::format("{}. {}.\n   To fix it: {}.\n", i + 1, diagnosis.findings[i].found, diagnosis.findings[i].mend);
  return out;
}

std::string diagnosis_json(const Diagnosis& diagnosis) {
  const Looked& looked = diagnosis.looked;
  Json out;
  out["usable"] = !looked.devices.empty();
  out["findings"] = Json::array();
  for (const Finding& finding : diagnosis.findings)
    out["findings"].push_back(
        {{"kind", finding.kind}, {"about", finding.about}, {"found", finding.found}, {"mend", finding.mend}});
  out["loader"] = {{"path", looked.loader.path},
                   {"ocl_icd", looked.loader.ocl_icd},
                   {"looks_in", looked.entries.place},
                   {"variable", text_or_null(looked.entries.variable)}};
  out["drivers"] = Json::array();
  for (const LookedDriver& driver : looked.drivers) out["drivers"].push_back(driver_json(driver));
  out["devices"] = Json::array();
  for (const LookedDevice& device : looked.devices) {
    Json one = {{"index", device.index},
                {"platform", device.platform},
                {"device", device.device},
                {"platform_name", device.platform_name}};
    one.update(device_json(device.seen));
    out["devices"].push_back(std::move(one));
  }
  out["installed"] = Json::array();
  for (const InstalledDriver& driver : looked.installed)
    out["installed"].push_back({{"vendor", driver.vendor}, {"path", driver.path}});
  out["files"] = Json::array();
  for (const auto* all : {&looked.files.nvidia, &looked.files.amd, &looked.files.render})
    for (const DeviceFile& file : *all) out["files"].push_back(file_json(file));
  out["container"] = looked.files.container;
  out["caches"] = Json::array();
  for (const Cache& cache : looked.caches)
    out["caches"].push_back({{"of", cache.of},
                             {"path", cache.folder.path},
                             {"variable", text_or_null(cache.folder.variable)},
                             {"writable", cache.writable}});
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace vsplat
