#include "runtime/system/driver_entries.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "runtime/opencl.h"
#include "runtime/system/environment.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

const std::string default_folder = "/etc/OpenCL/vendors";

bool is_entry(const std::string& name) { return name.size() > 4 && name.ends_with(".icd"); }

// Reads the first line, as loaders do: up to the last blank.
DriverEntry entry_of(const fs::path& file) {
  DriverEntry out;
  out.file = file.string();
  std::error_code error;
  if (fs::is_directory(file, error)) {
    out.problem = "is a folder";
    return out;
  }
  std::ifstream in(file);
  if (!in) {
    out.problem = std::string("cannot be read: ") + std::strerror(errno);
    return out;
  }
  char line[4096] = {};
  in.getline(line, sizeof line);
  out.library = line;
  if (out.library.empty()) out.problem = "is empty";
  return out;
}

std::vector<DriverEntry> entries_in(const fs::path& folder, std::string& problem) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error))
    if (is_entry(at->path().filename().string())) files.push_back(at->path());
  if (error) problem = error == std::errc::no_such_file_or_directory ? "is not there" : error.message();
  std::sort(files.begin(), files.end());
  std::vector<DriverEntry> out;
  out.reserve(files.size());
  for (const fs::path& file : files) out.push_back(entry_of(file));
  return out;
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> out;
  std::istringstream in(text);
  for (std::string part; std::getline(in, part, ':');)
    if (!part.empty()) out.push_back(part);
  return out;
}

// Handles an OCL_ICD_VENDORS that is no folder, as ocl-icd does: it names an entry by path, an entry of the default
// folder, or a library.
void take_file(DriverEntries& out, const std::string& vendors) {
  std::error_code error;
  const bool path = out.place.find('/') != std::string::npos;
  if (!is_entry(out.place)) {
    if (path && !fs::exists(out.place, error)) out.problem = "is not there";
    if (out.problem.empty()) out.entries.push_back({"", out.place, ""});
    return;
  }
  fs::path file = out.place;
  if (!path && fs::exists(fs::path(vendors) / file, error)) file = fs::path(vendors) / file;
  if (fs::exists(file, error))
    out.entries.push_back(entry_of(file));
  else
    out.problem = "is not there";
}

// The folders that /etc/ld.so.conf and its included files list.
std::vector<std::string> configured_folders() {
  std::vector<std::string> out;
  std::vector<fs::path> files = {"/etc/ld.so.conf"};
  std::error_code error;
  for (fs::directory_iterator at("/etc/ld.so.conf.d", error), end; !error && at != end; at.increment(error))
    files.push_back(at->path());
  for (const fs::path& file : files) {
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);)
      if (line.starts_with('/')) out.push_back(line.substr(0, line.find_first_of(" \t#")));
  }
  return out;
}

struct Folder {
  std::string path;
  bool searched;  // found by the system's loader
};

constexpr const char* usual_folders[] = {
#if defined(__aarch64__)
    "/usr/lib/aarch64-linux-gnu",
#else
    "/usr/lib/x86_64-linux-gnu",
#endif
    "/usr/lib64", "/usr/lib"};
constexpr const char* vendors_folders[] = {"/usr/lib/x86_64-linux-gnu/intel-opencl",
                                           "/usr/lib64/intel-opencl",
                                           "/usr/lib/intel-opencl",
                                           "/usr/local/nvidia/lib64",
                                           "/usr/local/nvidia/lib",
                                           "/usr/local/cuda/compat",
                                           "/usr/lib/wsl/lib",
                                           "/run/opengl-driver/lib",
                                           "/usr/lib/nvidia",
                                           "/opt/rocm/lib",
                                           "/opt/rocm/opencl/lib",
                                           "/opt/amdgpu/lib64",
                                           "/opt/amdgpu/lib/x86_64-linux-gnu",
                                           "/opt/amdgpu-pro/lib/x86_64-linux-gnu"};

std::vector<Folder> library_folders() {
  std::vector<Folder> out;
  for (const std::string& path : split(environment("LD_LIBRARY_PATH"))) out.push_back({path, true});
  for (const std::string& path : configured_folders()) out.push_back({path, true});
  for (const char* path : usual_folders) out.push_back({path, true});
  for (const char* path : vendors_folders) out.push_back({path, false});
  std::error_code error;
  std::vector<std::string> versions;
  for (fs::directory_iterator at("/opt", error), end; !error && at != end; at.increment(error))
    if (at->path().filename().string().starts_with("rocm-")) versions.push_back((at->path() / "lib").string());
  std::sort(versions.rbegin(), versions.rend());
  for (const std::string& path : versions) out.push_back({path, false});
  return out;
}

// Files of that name, with or without a version, each once even if several links lead to it.
std::vector<InstalledDriver> files_called(const std::string& name, const std::vector<Folder>& folders) {
  std::vector<InstalledDriver> out;
  std::set<fs::path> seen;
  for (const Folder& folder : folders) {
    std::error_code error;
    std::vector<fs::path> names;
    if (fs::exists(fs::path(folder.path) / name, error)) {
      names = {name};
    } else {
      for (fs::directory_iterator at(folder.path, error), end; !error && at != end; at.increment(error))
        if (at->path().filename().string().starts_with(name + ".")) names.push_back(at->path().filename());
      std::sort(names.begin(), names.end());
    }
    for (const fs::path& file : names) {
      const fs::path path = fs::path(folder.path) / file, real = fs::canonical(path, error);
      if (error || !fs::is_regular_file(real, error) || !seen.insert(real).second) continue;
      InstalledDriver found;
      found.path = path.string();
      found.found = folder.searched;
      out.push_back(found);
    }
  }
  return out;
}

struct KnownDriver {
  const char *vendor, *library, *entry;
  bool is_gpu;
};
constexpr KnownDriver known_drivers[] = {
    {"NVIDIA", "libnvidia-opencl.so.1", "nvidia.icd", true},
    {"AMD", "libamdocl64.so", "amdocl64.icd", true},
    {"Intel", "libigdrcl.so", "intel.icd", true},
    {"PoCL", "libpocl.so.2", "pocl.icd", false},
    {"Intel (processors)", "libintelocl.so", "intel64.icd", false},
};

}  // namespace

DriverEntries driver_entries(bool ocl_icd) {
  DriverEntries out;
  std::string vendors = default_folder;
  if (ocl_icd && !environment("OPENCL_VENDOR_PATH").empty()) {
    out.variable = "OPENCL_VENDOR_PATH";
    vendors = environment(out.variable.c_str());
  }
  out.place = vendors;
  if (!environment("OCL_ICD_VENDORS").empty()) {
    out.variable = "OCL_ICD_VENDORS";
    out.place = environment(out.variable.c_str());
  }
  std::error_code error;
  out.folder = out.variable.empty() || fs::is_directory(out.place, error) || !ocl_icd;
  if (out.folder)
    out.entries = entries_in(out.place, out.problem);
  else
    take_file(out, vendors);
  if (!ocl_icd)
    for (const std::string& library : split(environment("OCL_ICD_FILENAMES"))) out.entries.push_back({"", library, ""});
  return out;
}

OpenClLoader opencl_loader() {
  OpenClLoader out;
  const std::string library = sys::library_of(reinterpret_cast<const void*>(&clGetPlatformIDs));
  if (library.empty()) return out;
  std::error_code error;
  out.path = fs::absolute(library, error).string();
  // Each loader contains the name of a variable that the other does not know. (Asking ocl-icd itself would load every
  // driver.)
  std::ifstream in(library, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  out.ocl_icd = bytes.find("OCL_ICD_ASSUME_ICD_EXTENSION") != std::string::npos;
  return out;
}

std::vector<InstalledDriver> installed_drivers() {
  const std::vector<Folder> folders = library_folders();
  std::vector<InstalledDriver> out;
  for (const KnownDriver& known : known_drivers) {
    std::vector<InstalledDriver> files = files_called(known.library, folders);
    if (files.empty()) continue;
    InstalledDriver& first = out.emplace_back(files.front());
    first.vendor = known.vendor, first.entry = known.entry, first.is_gpu = known.is_gpu;
  }
  return out;
}

std::vector<std::string> installed_libraries(const std::string& name) {
  std::vector<std::string> out;
  for (const InstalledDriver& file : files_called(name, library_folders())) out.push_back(file.path);
  return out;
}

}  // namespace vsplat
