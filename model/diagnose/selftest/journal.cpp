#include "model/diagnose/selftest/journal.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "runtime/error.h"
#include "runtime/files/private_folder.h"
#include "runtime/log.h"
#include "runtime/tuning/stored_finding.h"

namespace vsplat::selftest {
namespace {

constexpr int kUnseenEnds = 2;  // so many are no coincidence

}  // namespace

std::string Journal::folder_of(const DeviceInfo& device) {
  const std::string path = stored_finding_path(device, "journal 1", "selftests");
  return path.empty() ? "" : std::filesystem::path(path).replace_extension().string();
}

Journal::Journal(const std::string& folder, const std::string& ended) {
  if (folder.empty()) return;
  try {
    make_private_folder(folder);
    lock_ = std::make_unique<FolderLock>(folder);
    path_ = folder + "/journal.json";
    if (read(ended)) write();
  } catch (const Error& e) {
    verbose("no journal of the self-test: {}", e.what());
    path_.clear();
  }
}

// Returns whether an item was in progress.
bool Journal::read(const std::string& ended) {
  const auto text = stored_finding(path_);
  const nlohmann::json json = text ? nlohmann::json::parse(*text, nullptr, false) : nlohmann::json();
  if (!json.is_object()) return false;
  try {
    for (const nlohmann::json& one : json.at("ended"))
      ends_[one.at("doing")] = {one.at("times"), one.at("how"), one.at("kernel")};
    const std::string doing = json.at("doing");
    if (doing.empty()) return false;
    End& end = ends_[doing];
    end.times += ended.empty() ? 1 : kUnseenEnds;
    if (!ended.empty()) end.how = ended;
    end.kernel = json.at("kernel");
    return true;
  } catch (const nlohmann::json::exception&) {  // written by another version
    ends_.clear();
    return false;
  }
}

std::string Journal::ended_by(const std::string& doing) const {
  const auto found = ends_.find(doing);
  if (found == ends_.end() || found->second.times < kUnseenEnds) return "";
  const End& end = found->second;
  std::string out = "it ended the self-test's process";
  if (!end.how.empty()) out += ": " + end.how;
  if (!end.kernel.empty()) out += "; the kernel compiled last was " + end.kernel;
  return out;
}

void Journal::begins(const std::string& doing) {
  const std::lock_guard lock(mutex_);
  doing_ = doing;
  kernel_.clear();
  write();
}

void Journal::compiles(const std::string& kernel) {
  const std::lock_guard lock(mutex_);
  kernel_ = kernel;
  write();
}

void Journal::done() {
  const std::lock_guard lock(mutex_);
  ends_.clear();
}

Journal::~Journal() {
  doing_.clear();
  kernel_.clear();
  std::error_code ignored;
  if (!ends_.empty())
    write();
  else if (!path_.empty())
    std::filesystem::remove(path_, ignored);
}

void Journal::write() {
  if (path_.empty()) return;
  nlohmann::ordered_json json{{"doing", doing_}, {"kernel", kernel_}, {"ended", nlohmann::json::array()}};
  for (const auto& [doing, end] : ends_)
    json["ended"].push_back({{"doing", doing}, {"times", end.times}, {"how", end.how}, {"kernel", end.kernel}});
  try {
    keep_finding(path_, json.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  } catch (const Error& e) {
    verbose("no journal of the self-test: {}", e.what());
    path_.clear();
  }
}

}  // namespace vsplat::selftest
