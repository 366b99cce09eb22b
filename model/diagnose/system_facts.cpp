#include "model/diagnose/system_facts.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "runtime/error.h"
#include "runtime/files/cache_folders.h"
#include "runtime/json_text.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t most_bytes = 1 << 18, most_files = 100;
constexpr std::size_t most_peaks = 1 << 12;  // limit of a measurement's bytes, which is stored like compiled kernels

// Matched by full name: a similarly named variable may hold a key or a password, for instance NVIDIA_API_KEY.
constexpr const char* listed_variables[] = {
    "CLOVER_DEVICE_TYPE",
    "CUDA_CACHE_DISABLE",
    "CUDA_CACHE_MAXSIZE",
    "CUDA_CACHE_PATH",
    "CUDA_DEVICE_ORDER",
    "CUDA_VISIBLE_DEVICES",
    "GPU_DEVICE_ORDINAL",
    "GPU_FORCE_64BIT_PTR",
    "GPU_MAX_ALLOC_PERCENT",
    "GPU_MAX_HEAP_SIZE",
    "GPU_SINGLE_ALLOC_PERCENT",
    "HIP_VISIBLE_DEVICES",
    "HOME",
    "HSA_OVERRIDE_GFX_VERSION",
    "LD_LIBRARY_PATH",
    "LD_PRELOAD",
    "LP_NUM_THREADS",
    "MESA_LOADER_DRIVER_OVERRIDE",
    "MESA_SHADER_CACHE_DIR",
    "MESA_SHADER_CACHE_DISABLE",
    "NEOReadDebugKeys",
    "NVIDIA_DRIVER_CAPABILITIES",
    "NVIDIA_VISIBLE_DEVICES",
    "OCL_ICD_ASSUME_ICD_EXTENSION",
    "OCL_ICD_DEFAULT_PLATFORM",
    "OCL_ICD_FILENAMES",
    "OCL_ICD_PLATFORM_SORT",
    "OCL_ICD_VENDORS",
    "ONEAPI_DEVICE_SELECTOR",
    "OPENCL_LAYERS",
    "OPENCL_VENDOR_PATH",
    "POCL_AFFINITY",
    "POCL_BUILDING",
    "POCL_CACHE_DIR",
    "POCL_CPU_LOCAL_MEM_SIZE",
    "POCL_CPU_MAX_CU_COUNT",
    "POCL_DEBUG",
    "POCL_DEVICES",
    "POCL_EXTRA_BUILD_FLAGS",
    "POCL_KERNEL_CACHE",
    "POCL_MAX_COMPUTE_UNITS",
    "POCL_MAX_PTHREAD_COUNT",
    "POCL_MAX_WORK_GROUP_SIZE",
    "POCL_MEMORY_LIMIT",
    "POCL_WORK_GROUP_METHOD",
    "ROCR_VISIBLE_DEVICES",
    "RUSTICL_CL_VERSION",
    "RUSTICL_DEBUG",
    "RUSTICL_DEVICE_TYPE",
    "RUSTICL_ENABLE",
    "RUSTICL_FEATURES",
    "VSPLAT_ARENA",
    "VSPLAT_CACHE_DIR",
    "VSPLAT_CHECK",
    "VSPLAT_DEVICE",
    "VSPLAT_KERNELS",
    "VSPLAT_KERNEL_DIR",
    "VSPLAT_LIMITS",
    "VSPLAT_SELFTEST",
    "VSPLAT_TUNING",
    "XDG_CACHE_HOME",
    "ZE_AFFINITY_MASK",
};

// The text after `name` and a separator in the first line that begins with it.
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

bool is_plain(const fs::path& file) {
  std::error_code error;
  return fs::symlink_status(file, error).type() == fs::file_type::regular;
}

// "HASH.bin", the cache's file names.
bool is_entry(const fs::path& file) {
  const std::string stem = file.stem().string();
  return file.extension() == ".bin" && stem.size() == 64 &&
         stem.find_first_not_of("0123456789abcdef") == std::string::npos;
}

// The files that this library itself wrote there and that are not code; the folder may hold other files.
std::vector<fs::path> stored_files(const fs::path& folder) {
  std::vector<fs::path> out;
  std::error_code error;
  const auto add = [&](const fs::path& in, const auto& wanted) {
    for (fs::directory_iterator at(in, error), end; !error && at != end; at.increment(error))
      if (wanted(at->path()) && is_plain(at->path())) out.push_back(at->path());
  };
  for (const char* name : {"verdicts", "tuning"})
    add(folder / name, [](const fs::path& file) { return file.extension() == ".json"; });
  add(folder, [](const fs::path& file) {
    std::error_code failed;
    return is_entry(file) && fs::file_size(file, failed) <= most_peaks && !failed;
  });
  std::sort(out.begin(), out.end());
  return out;
}

// (disk_cache.h documents the format of an entry.)
bool is_json_entry(const std::string& text) {
  const std::size_t payload = text.find('{');
  return text.starts_with("vsplat-kernel-") && payload < 100;
}

// Empty if the text is no JSON, or is unsafe to walk.
Json json_of(const std::string& text) {
  try {
    parse_json("a kept file", text);
    return Json::parse(text);
  } catch (const Error&) {
    return nullptr;
  }
}

}  // namespace

Json system_facts() {
  Json out;
  const sys::Host host = sys::this_host();
  out["kernel"] = host.kernel;
  out["machine"] = host.machine;
  out["system"] = value_in("/etc/os-release", "PRETTY_NAME");
  out["libc"] = host.libc;
  out["processor"] = value_in("/proc/cpuinfo", "model name");
  out["processors"] = host.processors;
  out["memory"] = host.memory;
  return out;
}

Json environment_facts() {
  Json out = Json::object();
  for (const char* name : listed_variables)
    if (const char* value = std::getenv(name)) out[name] = value;
  return out;
}

Json stored_facts() {
  Json out = Json::array();
  const fs::path folder = own_cache().path;
  if (folder.empty()) return out;
  for (const fs::path& file : stored_files(folder)) {
    std::error_code error;
    Json one = {{"file", file.lexically_relative(folder).string()}};
    std::string text = fs::file_size(file, error) <= most_bytes ? bytes_of(file) : "";
    if (file.extension() == ".bin") {
      if (!is_json_entry(text)) continue;
      text.erase(0, text.find('{'));
    }
    Json content = out.size() < most_files ? json_of(text) : Json();
    if (content.is_null())
      one["bytes"] = fs::file_size(file, error);
    else
      one["content"] = std::move(content);
    out.push_back(std::move(one));
  }
  return out;
}

}  // namespace vsplat
