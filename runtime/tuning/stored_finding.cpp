#include "runtime/tuning/stored_finding.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <chrono>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/files/disk_cache.h"
#include "runtime/files/file.h"
#include "runtime/files/output_file.h"
#include "runtime/files/private_folder.h"
#include "runtime/system/environment.h"
#include "runtime/system/system.h"
#include "runtime/tuning/verdict.h"

namespace vsplat {

// While kernels are being edited (VSPLAT_KERNEL_DIR), findings are stored only in an explicitly named cache folder.
bool keeps_findings() { return environment("VSPLAT_KERNEL_DIR").empty() || !environment("VSPLAT_CACHE_DIR").empty(); }

std::string today() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  return fmt::format("{:%Y-%m-%d}", fmt::gmtime(now));
}

std::string stored_finding_path(const DeviceInfo& d, const std::string& subject, const std::string& folder) {
  const DiskCache cache;
  if (!cache.enabled() || !keeps_findings()) return "";
  const std::string key =
      DiskCache::key({subject, d.name, d.vendor, d.driver, d.version, d.platform_name, d.platform_version,
                      std::to_string(d.compute_units), d.lowered, kernels_hash()});
  return cache.folder() + "/" + folder + "/" + key.substr(0, 32) + ".json";
}

std::optional<std::string> stored_finding(const std::string& path) {
  const std::optional<sys::FileFacts> found = path.empty() ? std::nullopt : sys::facts_of_entry(path);
  if (!found) return std::nullopt;
  if (!found->is_file() || !found->ours_alone)
    fail(Status::file, "{}: others may write to it: `chmod go-w` it if it is yours", path);
  const std::vector<unsigned char> text = found->size > 1 << 20 ? std::vector<unsigned char>() : read_file(path);
  return std::string(text.begin(), text.end());
}

void keep_finding(const std::string& path, const std::string& text) {
  make_private_folder(std::filesystem::path(path).parent_path().string());
  OutputFile out(path, kOwnersAlone);
  out.write(text);
  out.commit();
}

}  // namespace vsplat
