// Where the OpenCL loader looks for drivers, and which it finds named there.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct DriverEntry {
  std::string file;     // *.icd; "" where a variable names the library
  std::string library;  // as it is named: a path, or what the system's loader looks for
  std::string problem;  // why the file names none; "": it does
};

struct DriverEntries {
  std::string variable;  // that says where to look; "": none does
  std::string place;     // the folder; or the one file or library that the variable names
  bool folder = false;
  std::string problem;  // why the place is none; "": it is one
  std::vector<DriverEntry> entries;
};

// As ocl-icd does, or Khronos' loader: they differ in what variables they heed.
DriverEntries driver_entries(bool ocl_icd);

// The loader that this library is linked with.
struct OpenClLoader {
  std::string path;
  bool ocl_icd = false;
};
OpenClLoader opencl_loader();

// A driver's library where vendors install it, or where the system looks.
struct InstalledDriver {
  std::string vendor;   // "NVIDIA"
  std::string path;     // of the library
  std::string entry;    // what its entry is called: "nvidia.icd"
  bool is_gpu = false;  // alone: none for processors
  bool found = true;    // by the system's loader without a path
};
// One for each that is known; besides, any file of that name. What is looked at: LD_LIBRARY_PATH, the folders that
// /etc/ld.so.conf names, and where drivers and containers' tools put them.
std::vector<InstalledDriver> installed_drivers();
std::vector<std::string> installed_libraries(const std::string& name);

}  // namespace vsplat
