#include "model/train/run_record.h"

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <tuple>

#include "model/base/json_fields.h"
#include "runtime/files/file.h"
#include "runtime/json_text.h"

namespace vsplat {
namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr std::uintmax_t kLargest = std::uintmax_t{1} << 20;  // bytes: enough for some thousand parts

// Reads a part; returns whether it has all fields with the right types.
bool read_part(const json& from, RunRecord::Part& to) {
  const auto field = [&](const char* name, auto& value) {
    return from.is_object() && from.contains(name) && json_fields::read_field(from[name], value);
  };
  if (from.is_object() && from.contains("tuning")) field("tuning", to.tuning);  // (older files lack it)
  if (from.is_object() && from.contains("switched_off")) field("switched_off", to.switched_off);
  return field("device", to.device) && field("driver", to.driver) && field("kernels", to.kernels) &&
         field("limit_bytes", to.limit) && field("peak_bytes", to.peak) && field("first", to.first) &&
         field("last", to.last) && field("starts", to.starts) && field("seconds", to.seconds);
}

}  // namespace

bool RunRecord::Part::same_device(const Part& other) const {
  return std::tie(device, driver, kernels, tuning, switched_off) ==
         std::tie(other.device, other.driver, other.kernels, other.tuning, other.switched_off);
}

RunRecord::RunRecord(std::string path, long step, Part now) : path_(std::move(path)) {
  if (step > 0) read_parts(step);
  now.first = now.last = step;
  if (!parts_.empty() && parts_.back().same_device(now)) {
    ++parts_.back().starts;
    parts_.back().limit = now.limit;
    seconds_ = parts_.back().seconds;
    peak_ = parts_.back().peak;
  } else {
    parts_.push_back(std::move(now));
  }
}

// Drops what was done after the checkpoint, since it is done again.
void RunRecord::read_parts(long step) try {
  std::error_code problem;
  if (const auto size = std::filesystem::file_size(path_, problem); problem || size > kLargest) return;
  const std::vector<unsigned char> bytes = read_file(path_);
  const json whole = parse_json(path_, std::string(bytes.begin(), bytes.end()));
  if (!whole.is_object() || !whole.contains("parts") || !whole["parts"].is_array()) return;
  for (const json& entry : whole["parts"]) {
    Part part;
    if (!read_part(entry, part) || part.first >= step) continue;
    part.last = std::min(part.last, step);
    parts_.push_back(std::move(part));
  }
} catch (const Error&) {
  parts_.clear();
}

void RunRecord::set_data(const DataSet& data, const std::string& textures) {
  textures_ = textures;
  for (const DataObject& object : data.objects) {
    const std::string path = object.given.string();
    auto known = std::find_if(data_.begin(), data_.end(), [&](const Folder& folder) { return folder.path == path; });
    if (known == data_.end()) known = data_.insert(data_.end(), {path, 0});
    ++known->objects;
  }
}

void RunRecord::reach(long step, double seconds, std::uint64_t peak, int bad) {
  Part& part = parts_.back();
  part.last = step;
  part.seconds = seconds_ + seconds;
  part.peak = std::max(peak_, peak);
  bad_ = bad;
}

std::string RunRecord::text() const {
  ordered_json out;
  out["data"] = ordered_json::array();
  for (const Folder& folder : data_) out["data"].push_back({{"path", folder.path}, {"objects", folder.objects}});
  out["textures"] = textures_;
  out["bad"] = bad_;
  out["parts"] = ordered_json::array();
  for (const Part& part : parts_)
    out["parts"].push_back({{"device", part.device},
                            {"driver", part.driver},
                            {"kernels", part.kernels},
                            {"tuning", part.tuning},
                            {"switched_off", part.switched_off},
                            {"limit_bytes", part.limit},
                            {"peak_bytes", part.peak},
                            {"first", part.first},
                            {"last", part.last},
                            {"starts", part.starts},
                            {"seconds", part.seconds}});
  // Paths may be invalid UTF-8.
  return out.dump(2, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

void RunRecord::write() const {
  const std::string all = text();
  write_file(path_, all.data(), all.size());
}

}  // namespace vsplat
