// Findings about a device with its driver and these kernels, for instance a self-test's verdict (verdict.h), stored in
// the cache folder (disk_cache.h): one file for each subject, which other users may not write to.
#pragma once
#include <optional>
#include <string>

#include "runtime/device.h"

namespace vsplat {

// False if kernels come from a folder (VSPLAT_KERNEL_DIR) and no cache folder is set explicitly.
bool keeps_findings();
// The file of a finding, in a folder of the cache; empty if it is not stored. `subject` names the kind of finding and
// its format.
std::string stored_finding_path(const DeviceInfo& device, const std::string& subject,
                                const std::string& folder = "findings");
// Unset if there is no such file; empty text if it is too large. Error(file) if others may write to it.
std::optional<std::string> stored_finding(const std::string& path);
// Writes the whole file, or throws Error(file).
void keep_finding(const std::string& path, const std::string& text);

// "2026-11-23"
std::string today();

}  // namespace vsplat
