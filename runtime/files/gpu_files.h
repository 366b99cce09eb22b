// What the system shows of GPUs: that there are some, and the files through which drivers reach them.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace vsplat {

struct DeviceFile {
  std::string path;
  std::string problem;  // why it cannot be opened; "": it can
  std::string group;    // that may open it; "": not known
};

struct GpuFiles {
  std::vector<DeviceFile> nvidia;  // /dev/nvidia0 and so on, nvidiactl, nvidia-uvm; of WSL /dev/dxg
  std::vector<DeviceFile> amd;     // /dev/kfd
  std::vector<DeviceFile> render;  // /dev/dri/renderD*
  // A GPU of that vendor is there, or its kernel's driver, whatever this process may open.
  bool has_nvidia = false, has_amd = false, has_intel = false;
  bool container = false;

  bool nvidia_gpu() const;  // whether one of those files is a GPU
};

// Of the system whose files lie under `root`.
GpuFiles gpu_files(const std::filesystem::path& root = "/");

}  // namespace vsplat
