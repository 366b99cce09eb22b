#include "runtime/system_facts.h"

#include <gnu/libc-version.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "runtime/cache_folders.h"

extern char** environ;

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t most_bytes = 1 << 18, most_files = 100;
constexpr std::size_t most_peaks = 1 << 12;  // of a measurement, which is kept as compiled kernels are

// What follows `name` and a separator in the first line that begins with it.
std::string value_in(const char* path, const std::string& name) {
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(name)) continue;
    line.erase(0, line.find_first_of("=:") + 1);
    std::erase(line, '"');
    line.erase(0, line.find_first_not_of(" \t"));
    return line;
  }
  return "";
}

std::string bytes_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

// (disk_cache.h says what an entry is made of.)
bool is_json_entry(const std::string& text) {
  const std::size_t payload = text.find('{');
  return text.starts_with("vsplat-kernel-") && payload < 100;
}

}  // namespace

Json system_facts() {
  Json out;
  utsname names{};
  ::uname(&names);
  out["kernel"] = std::string(names.sysname) + " " + names.release;
  out["machine"] = names.machine;
  out["system"] = value_in("/etc/os-release", "PRETTY_NAME");
  out["libc"] = std::string("glibc ") + ::gnu_get_libc_version();
  out["processor"] = value_in("/proc/cpuinfo", "model name");
  out["processors"] = ::sysconf(_SC_NPROCESSORS_ONLN);
  out["memory"] =
      static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return out;
}

Json environment_facts() {
  std::vector<std::string> found;
  for (char** at = environ; at && *at; ++at) {
    const std::string variable = *at;
    for (const char* beginning :
         {"VSPLAT_", "OCL_ICD_", "OPENCL_", "POCL_", "RUSTICL_", "CLOVER_", "MESA_", "CUDA_VISIBLE", "CUDA_CACHE",
          "NVIDIA_", "ROCR_", "HIP_", "GPU_", "NEO", "LD_LIBRARY_PATH=", "LD_PRELOAD=", "HOME=", "XDG_CACHE_HOME="})
      if (variable.starts_with(beginning)) found.push_back(variable);
  }
  std::sort(found.begin(), found.end());
  Json out = Json::object();
  for (const std::string& variable : found)
    out[variable.substr(0, variable.find('='))] = variable.substr(variable.find('=') + 1);
  return out;
}

Json kept_facts() {
  Json out = Json::array();
  const fs::path folder = own_cache().path;
  std::vector<fs::path> files;
  std::error_code error;
  if (folder.empty()) return out;
  for (fs::recursive_directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const bool json = at->path().extension() == ".json";
    const bool small = at->path().extension() == ".bin" && at->file_size(error) <= most_peaks;
    if ((json || small) && at->symlink_status(error).type() == fs::file_type::regular) files.push_back(at->path());
  }
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) {
    Json one = {{"file", file.lexically_relative(folder).string()}};
    std::string text = fs::file_size(file, error) <= most_bytes ? bytes_of(file) : "";
    if (file.extension() == ".bin") {
      if (!is_json_entry(text)) continue;
      text.erase(0, text.find('{'));
    }
    Json content = Json::parse(text, nullptr, false);
    if (content.is_discarded() || out.size() >= most_files)
      one["bytes"] = fs::file_size(file, error);
    else
      one["content"] = std::move(content);
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace vsplat
