// What the system shows about GPUs: whether there are any, and the device files through which drivers reach them.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace vsplat {

struct DeviceFile {
  std::string path;
  std::string problem;  // why it cannot be opened; "" if it can
  std::string group;    // the group that may open it; "" if unknown
};

struct GpuFiles {
  std::vector<DeviceFile> nvidia;  // /dev/nvidia0 and so on, nvidiactl, nvidia-uvm; on WSL /dev/dxg
  std::vector<DeviceFile> amd;     // /dev/kfd
  std::vector<DeviceFile> render;  // /dev/dri/renderD*
  // There is a GPU of that vendor, or its kernel driver, whether or not this process may open it.
  bool has_nvidia = false, has_amd = false, has_intel = false;
  bool container = false;

  bool nvidia_gpu() const;  // whether one of those files is a GPU
};

// Examines the system whose files lie under `root`.
GpuFiles gpu_files(const std::filesystem::path& root = "/");

}  // namespace vsplat
