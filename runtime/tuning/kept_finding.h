// What was found of a device with its driver and these kernels, a self-test's verdict (verdict.h) among it, kept in the
// cache's folder (disk_cache.h): a file of its own for each subject, which nobody else may write to.
#pragma once
#include <optional>
#include <string>

#include "runtime/device.h"

namespace vsplat {

// False where kernels at hand have no folder of their own to keep it in.
bool keeps_findings();
// Where it is kept, in a folder of the cache's; empty: nowhere. `subject` names what it is of, and its format.
std::string kept_finding_path(const DeviceInfo& device, const std::string& subject,
                              const std::string& folder = "findings");
// None where there is no such file; nothing of one that is too large. Error(file) where others may write to it.
std::optional<std::string> kept_finding(const std::string& path);
// Whole, or an Error(file).
void keep_finding(const std::string& path, const std::string& text);

// "2026-11-23"
std::string today();

}  // namespace vsplat
