#include "runtime/tuning/verdict.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>

#include "runtime/fail.h"
#include "runtime/files/disk_cache.h"
#include "runtime/files/sha256.h"
#include "runtime/log.h"
#include "runtime/option.h"
#include "runtime/program.h"
#include "runtime/system/environment.h"
#include "runtime/tuning/stored_finding.h"
#include "runtime/tuning/stored_verdicts.h"

namespace vsplat {
namespace {

std::string hash_of_all() {
  Sha256 hash;
  for (const std::string& name : kernel_file_names()) {
    const std::string text = kernel_text(name), head = fmt::format("{} {}\n", name, text.size());
    hash.add(head.data(), head.size());
    hash.add(text.data(), text.size());
  }
  return hash.hex();
}

// Verdicts have a folder of their own, for `report` and for people.
std::string verdict_path(const DeviceInfo& device) { return stored_finding_path(device, "verdict 1", "verdicts"); }

// Warns once: a device is queried several times.
void warn_once(const std::string& text) {
  static std::mutex mutex;
  static auto& printed = *new std::set<std::string>;  // never destroyed: jobs may run until the process ends
  const std::lock_guard lock(mutex);
  if (printed.insert(text).second) warn("{}", text);
}

nlohmann::json stored_verdict(const std::string& path) {
  const std::optional<std::string> text = stored_finding(path);
  if (!text) return nullptr;
  nlohmann::json out = nlohmann::json::parse(*text, nullptr, false);
  if (!out.is_object()) fail(Status::format, "{}: is damaged", path);
  return out;
}

Verdict verdict_in(const nlohmann::json& json) {
  Verdict out;
  const std::string fitness = json.at("verdict");
  for (const Fitness one : {Fitness::ok, Fitness::degraded, Fitness::unusable})
    if (fitness == name_of(one)) out.fitness = one;
  for (const std::string name : json.at("off"))
    for (const SwitchName& one : switch_names())
      if (name == one.name) out.off.*one.which = true;
  out.worst = json.at("worst");
  out.date = json.at("date");
  if (json.contains("refused")) out.refused = json.at("refused").get<std::vector<std::string>>();
  if (json.contains("mixed_loss")) out.mixed_loss = json.at("mixed_loss").get<double>();
  return out;
}

}  // namespace

const std::vector<SwitchName>& switch_names() {
  static const auto& names = *new std::vector<SwitchName>{
      {&SwitchedOff::cpu, "cpu", "cpu kernels"},
      {&SwitchedOff::gpu, "gpu", "gpu kernels"},
      {&SwitchedOff::winograd, "winograd", "Winograd's convolutions"},
      {&SwitchedOff::vectors, "vectors", "vectors of 16"},
      {&SwitchedOff::large_tiles, "large_tiles", "tiles of 128 x 128"},
      {&SwitchedOff::sub_groups, "sub_groups", "chosen sub-groups"},
      {&SwitchedOff::clblast, "clblast", "CLBlast"},
      {&SwitchedOff::tuned, "tuned", "tuned parameters that are wrong"},
      {&SwitchedOff::mixed, "mixed", "mixed precision"},
  };
  return names;
}

std::string in_words(const SwitchedOff& off) {
  std::string out;
  for (const SwitchName& one : switch_names())
    if (off.*one.which) out += (out.empty() ? "" : ", ") + std::string(one.words);
  return out;
}

const char* name_of(Fitness fitness) {
  return fitness == Fitness::ok ? "ok" : fitness == Fitness::degraded ? "degraded" : "unusable";
}

std::string kernels_hash() {
  if (!environment("VSPLAT_KERNEL_DIR").empty())
    return hash_of_all();  // kernels that may change while the process
                           // runs
  static const auto& embedded = *new std::string(hash_of_all());
  return embedded;
}

std::optional<Verdict> remembered_verdict(const DeviceInfo& device) {
  try {
    const nlohmann::json json = stored_verdict(verdict_path(device));
    if (json.is_null()) return std::nullopt;
    return verdict_in(json);
  } catch (const nlohmann::json::exception&) {  // written by another version
    return std::nullopt;
  } catch (const Error& e) {  // an unreadable file counts as no verdict
    warn_once(fmt::format("a self-test's verdict on {} is not used: {}; {} makes a new one", device.name, e.what(),
                          Option::selftest));
    return std::nullopt;
  }
}

std::vector<StoredVerdict> stored_verdicts() {
  std::vector<StoredVerdict> out;
  const DiskCache cache;
  if (!cache.enabled() || !keeps_findings()) return out;
  std::vector<std::string> paths;
  std::error_code error;
  for (std::filesystem::directory_iterator at(cache.folder() + "/verdicts", error), end; !error && at != end;
       at.increment(error))
    if (at->path().extension() == ".json") paths.push_back(at->path().string());
  std::sort(paths.begin(), paths.end());
  for (const std::string& path : paths) {
    try {
      const nlohmann::json json = stored_verdict(path);
      if (json.at("kernels") == kernels_hash() && json.value("limits", "") == environment("VSPLAT_LIMITS"))
        out.push_back({json.at("device"), json.at("driver"), verdict_in(json)});
    } catch (const std::exception& e) {  // unreadable, so its device is unknown; reported when that device is opened
      verbose("{}: {}", path, e.what());
    }
  }
  return out;
}

bool remember(const DeviceInfo& device, const Verdict& verdict) {
  const std::string path = verdict_path(device);
  if (path.empty()) {
    warn("the self-test's verdict is not stored: {}",
         keeps_findings()
             ? "there is no folder to store it in, since VSPLAT_CACHE_DIR is off, or others may write to that folder"
             : "VSPLAT_KERNEL_DIR is set, but VSPLAT_CACHE_DIR names no folder of its own for such kernels");
    return false;
  }
  nlohmann::ordered_json json{{"verdict", name_of(verdict.fitness)},
                              {"off", nlohmann::json::array()},
                              {"worst", verdict.worst},
                              {"date", verdict.date},
                              {"refused", verdict.refused},
                              {"device", device.name},
                              {"driver", device.driver},
                              {"limits", device.lowered},
                              {"kernels", kernels_hash()}};
  for (const SwitchName& one : switch_names())
    if (verdict.off.*one.which) json["off"].push_back(one.name);
  if (verdict.mixed_loss) json["mixed_loss"] = *verdict.mixed_loss;
  try {
    keep_finding(path, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    return true;
  } catch (const Error& e) {
    warn("the self-test's verdict is not stored: {}; set VSPLAT_CACHE_DIR to a folder that can be written", e.what());
    return false;
  }
}

SwitchedOff fit_for_use(const DeviceInfo& device) {
  if (environment("VSPLAT_SELFTEST") == "ignore") return {};
  const std::optional<Verdict> verdict = remembered_verdict(device);
  if (!verdict) return {};
  if (verdict->fitness == Fitness::unusable)
    fail(Status::device,
         "{} with driver {} computes wrongly, and there is no other way to compute: {} (self-test of {}). Take another "
         "device or another driver, or set VSPLAT_SELFTEST=ignore to use it all the same",
         device.name, device.driver, verdict->worst, verdict->date);
  if (verdict->off.any())
    verbose("{}: not used since the self-test of {}: {}", device.name, verdict->date, in_words(verdict->off));
  return verdict->off;
}

bool mixed_is_as_good(const DeviceInfo& device) {
  constexpr double most = 0.02;
  if (environment("VSPLAT_SELFTEST") == "ignore") return false;
  const std::optional<Verdict> verdict = remembered_verdict(device);
  return verdict && verdict->fitness == Fitness::ok && verdict->mixed_loss && *verdict->mixed_loss < most;
}

std::vector<std::string> refused_choices(const DeviceInfo& device) {
  if (environment("VSPLAT_SELFTEST") == "ignore") return {};
  const std::optional<Verdict> verdict = remembered_verdict(device);
  return verdict ? verdict->refused : std::vector<std::string>();
}

}  // namespace vsplat
