// A profile as a table, as JSON, and as a timeline for Chrome and Perfetto.
#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "runtime/precision.h"
#include "runtime/profile/profile_sums.h"

namespace vsplat {

// The subject of a profile.
struct ProfileSubject {
  std::string device, driver;
  std::uint64_t peak_bytes = 0;                            // of the device's memory
  std::vector<std::pair<std::string, std::string>> names;  // "model", "scene", ...: what the program provides
  std::optional<Peaks> peaks = {};
  std::string tuning = {};  // the hash of the table of tuned parameters; empty: none
  Precision precision = Precision::fp32;
};

std::string profile_table(const Profile& profile, const std::optional<Peaks>& peaks = std::nullopt);
std::string profile_json(const Profile& profile, const ProfileSubject& subject);
std::string profile_trace(const Profile& profile);

}  // namespace vsplat
