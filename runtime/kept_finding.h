// What was found of a device with its driver and these kernels beside a self-test's verdict (verdict.h), kept in the
// cache's folder (disk_cache.h): in `findings/`, a file of its own for each subject, which nobody else may write to.
#pragma once
#include <optional>
#include <string>

#include "runtime/device.h"

namespace vsplat {

// Where it is kept; empty: nowhere. `subject` names what it is of, and its format.
std::string kept_finding_path(const DeviceInfo& device, const std::string& subject);
// None where there is no such file; nothing of one that is too large. Error(file) where others may write to it.
std::optional<std::string> kept_finding(const std::string& path);
// Whole or not at all. False where it cannot be kept.
bool keep_finding(const std::string& path, const std::string& text);

// "2026-11-23"
std::string today();

}  // namespace vsplat
