#include "runtime/program.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "runtime/embedded.h"
#include "runtime/fail.h"
#include "runtime/files/pocl_files.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/system/environment.h"

namespace vsplat {
namespace {

// The file of that name in `folder` or in one of its subfolders, as cl/ is organised by family.
std::filesystem::path path_below(const std::filesystem::path& folder, const std::string& name) {
  std::error_code error;
  if (std::filesystem::exists(folder / name, error)) return folder / name;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error))
    if (std::filesystem::exists(entry.path() / name, error)) return entry.path() / name;
  return folder / name;
}

}  // namespace

std::vector<std::string> kernel_file_names() {
  std::vector<std::string> out;
  if (const char* folder = std::getenv("VSPLAT_KERNEL_DIR"); folder && *folder) {
    std::error_code error;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, error))
      if (entry.is_regular_file(error)) out.push_back(entry.path().filename().string());
    if (error) fail(Status::file, "{}: cannot be read (VSPLAT_KERNEL_DIR is set)", folder);
  } else {
    std::size_t count = 0;
    const EmbeddedFile* files = vsplat_embedded_files(&count);
    for (std::size_t i = 0; i < count; ++i) out.emplace_back(files[i].name);
  }
  std::sort(out.begin(), out.end());
  return out;
}

std::string kernel_text(const std::string& name) {
  if (const char* folder = std::getenv("VSPLAT_KERNEL_DIR"); folder && *folder) {
    const std::filesystem::path path = path_below(folder, name);
    std::ifstream in(path, std::ios::binary);
    if (!in) fail(Status::file, "{}: cannot be read (VSPLAT_KERNEL_DIR is set)", path.string());
    std::stringstream text;
    text << in.rdbuf();
    return text.str();
  }
  std::size_t count = 0;
  const EmbeddedFile* files = vsplat_embedded_files(&count);
  for (std::size_t i = 0; i < count; ++i)
    if (name == files[i].name) return files[i].text;
  fail(Status::internal, "no kernel file {}", name);
}

namespace {

void expand(const std::string& name, std::set<std::string>& seen, std::string& out) {
  seen.insert(name);
  out += fmt::format("#line 1 \"{}\"\n", name);
  std::istringstream lines(kernel_text(name));
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::string key = "#include \"";
    if (line.rfind(key, 0) != 0) {
      out += line + "\n";
      continue;
    }
    const std::string included = line.substr(key.size(), line.find('"', key.size()) - key.size());
    if (!seen.count(included)) expand(included, seen, out);
    out += fmt::format("#line {} \"{}\"\n", number + 1, name);
  }
}

}  // namespace

std::string expanded_source(const std::string& file) {
  std::set<std::string> seen;
  std::string out;
  expand(file + ".cl", seen, out);
  return out;
}

std::string build_options(const std::string& defines) {
  return "-cl-std=CL1.2" + (defines.empty() ? "" : " " + defines);
}

// No disk cache for PoCL: it compiles a second, generic variant when asked for binaries, and has a cache of its own.
ProgramCache::ProgramCache(cl::Context context, cl::Device device, DeviceInfo info,
                           std::function<void(const std::string&, int)> on_compile)
    : context_(std::move(context)),
      device_(std::move(device)),
      info_(std::move(info)),
      on_compile_(std::move(on_compile)),
      disk_(info_.is_pocl ? DiskCache("") : DiskCache()),
      marks_(info_.is_pocl ? DiskCache() : DiskCache("")) {
  if (info_.is_pocl) mend_pocl_files();
}

bool ProgramCache::build_from_disk(const std::string& key, const std::string& options, cl::Program& out) const {
  const auto binary = disk_.load(key);
  if (!binary) return false;
  try {
    out = cl::Program(context_, {device_}, {*binary});
    out.build({device_}, options.c_str());
    return true;
  } catch (const cl::Error&) {  // the driver rejects its own binary: build from source
    return false;
  }
}

void ProgramCache::save_to_disk(const std::string& key, const cl::Program& program) const {
  if (!disk_.enabled()) return;
  try {
    const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
    if (!binaries.empty() && !binaries[0].empty()) disk_.store(key, binaries[0]);
  } catch (const cl::Error&) {  // this driver gives no binaries
  }
}

namespace {

std::string build_log(const cl::Program& program, const cl::Device& device) {
  try {
    return program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device);
  } catch (const cl::Error&) {
    return "(the driver gives no build log)";
  }
}

}  // namespace

cl::Program ProgramCache::build(const std::string& file, const std::string& defines, bool from_source) {
  std::string options = build_options(defines);
  // PoCL's compiler counts its warnings on stderr, such as those about vectors that are wider than a CPU's registers.
  if (info_.is_pocl) options += " -w";
  if (info_.sub_group >= 0) options += " -DSUB_GROUP=" + std::to_string(info_.sub_group);
  std::string source = expanded_source(file);
  // If the device has no fp64, possibly only by VSPLAT_LIMITS, its compiler must reject doubles, too.
  if (!info_.fp64) source = "#define double no_double_on_this_device\n" + source;
  std::vector<std::string> parts = {
      "1", source, options, info_.name, info_.driver, info_.version, info_.platform_version};
  if (marks_.enabled())
    parts.insert(parts.end(), {"mark", environment("POCL_CACHE_DIR"), environment("XDG_CACHE_HOME")});
  const std::string key = disk_.enabled() || marks_.enabled() ? DiskCache::key(parts) : "";
  cl::Program program;
  if (!from_source && disk_.enabled() && build_from_disk(key, options, program)) {
    from_disk_.insert(file + "\n" + defines);
    return program;
  }

  const bool known = marks_.load(key).has_value();
  if (!known) {
    if (on_compile_) on_compile_(file, compiled_);
    ++compiled_;
  }
  if (info_.is_pocl && !known) need_space_for_pocl();
  // PoCL's compiler (LLVM's signal handlers) removes the files that it is writing when a signal arrives, whatever the
  // program does with the signal. A build that fails for any other reason fails again.
  for (int left = info_.is_pocl ? 2 : 0;; --left) {
    program = cl::Program(context_, source);
    try {
      program.build({device_}, options.c_str());
      break;
    } catch (const cl::Error& e) {
      if (left > 0) continue;
      const std::string more = info_.is_pocl ? environment("POCL_EXTRA_BUILD_FLAGS") : "";
      fail(Status::compile, "cl/{}.cl does not compile on {} with {}{}: {}\n{}", file, info_.name, options,
           more.empty() ? "" : " and POCL_EXTRA_BUILD_FLAGS=" + printable(more), cl_error_name(e.err()),
           build_log(program, device_));
    }
  }
  save_to_disk(key, program);
  if (!known) marks_.store(key, {1});
  return program;
}

cl::Program& ProgramCache::program(const std::string& file, const std::string& defines) {
  const std::string key = file + "\n" + defines;
  const auto it = programs_.find(key);
  if (it != programs_.end()) return it->second;
  cl::Program built = build(file, defines, false);
  return programs_.emplace(key, std::move(built)).first->second;
}

cl::Kernel ProgramCache::kernel(const std::string& file, const std::string& name, const std::string& defines) {
  const std::lock_guard lock(mutex_);
  cl::Program& owner = program(file, defines);
  const auto made = [&]() -> cl::Kernel { return {owner, name.c_str()}; };
  // A program from disk may be valid but lack that kernel: then it is built from source.
  if (from_disk_.count(file + "\n" + defines) > 0) {
    try {
      return made();
    } catch (const cl::Error&) {
      from_disk_.erase(file + "\n" + defines);
      owner = build(file, defines, true);
    }
  }
  try {
    return made();
  } catch (const cl::Error& e) {
    fail(Status::internal, "cl/{}.cl has no kernel {}: {}", file, name, cl_error_name(e.err()));
  }
}

}  // namespace vsplat
