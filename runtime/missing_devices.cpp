#include "runtime/missing_devices.h"

#include <fmt/format.h>

#include <cstdlib>
#include <vector>

#include "runtime/files/cache_folders.h"
#include "runtime/opencl.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

constexpr const char* pocl = "Portable Computing Language";

struct Driver {
  std::string name;
  bool devices = false;
};

std::vector<Driver> drivers() {
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {  // how the loader reports that there is no platform
    return {};
  }
  std::vector<Driver> out;
  for (const cl::Platform& platform : platforms) try {
      Driver& driver = out.emplace_back();
      driver.name = printable(platform.getInfo<CL_PLATFORM_NAME>().c_str());
      std::vector<cl::Device> devices;
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
      driver.devices = !devices.empty();
    } catch (const cl::Error&) {  // how the loader reports that a platform has no devices
    }
  return out;
}

std::string unusable(const std::vector<Driver>& drivers) {
  for (const Driver& driver : drivers) {
    if (driver.devices || driver.name != pocl || is_writable(pocl_cache().path)) continue;
    return fmt::format(
        "the driver {} (PoCL) is there, but gives no device: it keeps compiled kernels in {}, which cannot be written. "
        "Set POCL_CACHE_DIR to a folder that can be, or XDG_CACHE_HOME or HOME to one above it",
        driver.name, pocl_cache().path);
  }
  return "";
}

}  // namespace

std::string why_no_device() {
  const std::vector<Driver> found = drivers();
  if (found.empty())
    return "the loader found no platform. Install a driver (for a CPU: the Debian package pocl-opencl-icd) and check "
           "that /etc/OpenCL/vendors or OCL_ICD_VENDORS names it";
  if (const std::string reason = unusable(found); !reason.empty()) return reason;
  std::string names;
  for (const Driver& driver : found) names += (names.empty() ? "" : ", ") + driver.name;
  for (const char* name : {"POCL_DEVICES", "POCL_BUILDING"})
    if (const char* value = std::getenv(name); value && names.find(pocl) != std::string::npos)
      return fmt::format("no driver has one, of those that there are: {}; {} is \"{}\": try again with `unset {}`",
                         names, name, printable(value), name);
  return fmt::format(
      "no driver has one, of those that there are: {}. For a CPU install the Debian package pocl-opencl-icd, for a GPU "
      "its vendor's driver, and see that this user may open the device's files",
      names);
}

std::string unusable_drivers() { return unusable(drivers()); }

}  // namespace vsplat
