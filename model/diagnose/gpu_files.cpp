#include "model/diagnose/gpu_files.h"

#include <algorithm>
#include <cctype>
#include <fstream>

#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

DeviceFile device_file(const fs::path& path) {
  DeviceFile out;
  out.path = path.string();
  // Opens the file, since control groups may forbid what its mode allows.
  if (const std::error_code problem = sys::try_device(path)) out.problem = problem.message();
  out.group = sys::group_of(path);
  return out;
}

std::vector<DeviceFile> device_files(const fs::path& folder, const std::string& beginning) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().starts_with(beginning) && !at->is_directory(error)) paths.push_back(at->path());
  std::sort(paths.begin(), paths.end());
  std::vector<DeviceFile> out;
  out.reserve(paths.size());
  for (const fs::path& path : paths) out.push_back(device_file(path));
  return out;
}

std::string first_word(const fs::path& file) {
  std::ifstream in(file);
  std::string out;
  in >> out;
  return out;
}

// Finds the display controllers on the bus, which are visible in containers, too.
void look_at_bus(const fs::path& root, GpuFiles& out) {
  std::error_code error;
  for (fs::directory_iterator at(root / "sys/bus/pci/devices", error), end; !error && at != end; at.increment(error)) {
    if (!first_word(at->path() / "class").starts_with("0x03")) continue;
    const std::string vendor = first_word(at->path() / "vendor");
    out.has_nvidia = out.has_nvidia || vendor == "0x10de";
    out.has_amd = out.has_amd || vendor == "0x1002";
    out.has_intel = out.has_intel || vendor == "0x8086";
  }
}

}  // namespace

bool GpuFiles::nvidia_gpu() const {
  return std::any_of(nvidia.begin(), nvidia.end(), [](const DeviceFile& file) {
    return std::isdigit(static_cast<unsigned char>(file.path.back())) != 0 || file.path.ends_with("dxg");
  });
}

GpuFiles gpu_files(const fs::path& root) {
  GpuFiles out;
  out.nvidia = device_files(root / "dev", "nvidia");
  for (const DeviceFile& file : device_files(root / "dev", "dxg")) out.nvidia.push_back(file);
  std::erase_if(out.nvidia, [](const DeviceFile& file) {  // used only for display and management
    return file.path.ends_with("modeset") || file.path.ends_with("tools");
  });
  out.amd = device_files(root / "dev", "kfd");
  out.render = device_files(root / "dev/dri", "renderD");
  std::error_code error;
  look_at_bus(root, out);
  out.has_nvidia = out.has_nvidia || out.nvidia_gpu() || fs::exists(root / "proc/driver/nvidia", error);
  out.has_amd = out.has_amd || !out.amd.empty();
  out.container = fs::exists(root / ".dockerenv", error) || fs::exists(root / "run/.containerenv", error) ||
                  !first_word(root / "run/systemd/container").empty();
  return out;
}

}  // namespace vsplat
