// Where the OpenCL loader looks for drivers, and which drivers it finds there.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct DriverEntry {
  std::string file;     // *.icd; "" if a variable names the library
  std::string library;  // as written: a path, or a name for the system's loader to find
  std::string problem;  // why the file names no library; "" if it names one
};

struct DriverEntries {
  std::string variable;  // environment variable that says where to look; "": none
  std::string place;     // the folder, or the single file or library that the variable names
  bool folder = false;
  std::string problem;  // why the place cannot be used; "" if it can
  std::vector<DriverEntry> entries;
};

// The entries as ocl-icd finds them, or else Khronos' loader: the two obey different variables.
DriverEntries driver_entries(bool ocl_icd);

// The OpenCL loader that this library is linked with.
struct OpenClLoader {
  std::string path;
  bool ocl_icd = false;
};
OpenClLoader opencl_loader();

// A driver library at a vendor's usual place or in the system's library folders.
struct InstalledDriver {
  std::string vendor;   // "NVIDIA"
  std::string path;     // path of the library
  std::string entry;    // name of its entry file: "nvidia.icd"
  bool is_gpu = false;  // serves only GPUs, not processors
  bool found = true;    // the system's loader finds it without a path
};
// installed_drivers(): one item for each known driver. installed_libraries(): every library file of that name. Both
// search LD_LIBRARY_PATH, the folders in /etc/ld.so.conf, and the folders in which drivers and container tools install
// libraries.
std::vector<InstalledDriver> installed_drivers();
std::vector<std::string> installed_libraries(const std::string& name);

}  // namespace vsplat
