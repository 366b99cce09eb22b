// Kernel programs: embedded source -> includes expanded -> built with options -> kept in memory and, where the driver
// keeps none of its own, on disk.
#pragma once
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "runtime/device.h"
#include "runtime/files/disk_cache.h"
#include "runtime/opencl.h"

namespace vsplat {

// Every file of cl/ that the library carries, or that $VSPLAT_KERNEL_DIR has, by name; and the text of one.
std::vector<std::string> kernel_file_names();
std::string kernel_text(const std::string& name);

// The text of cl/<file>.cl with `#include "x.clh"` replaced by the file (each once) and #line markers, so that build
// logs name the file and line. $VSPLAT_KERNEL_DIR, where set, is read instead of what is embedded.
std::string expanded_source(const std::string& file);
// What a program with these defines is built with, but for -DSUB_GROUP, which a build adds where the device tells it
// (cl/many_registers.clh).
std::string build_options(const std::string& defines);

// Of one opened device, for all of its streams. Thread-safe: one program is built at a time.
class ProgramCache {
 public:
  // `on_compile`: called before a program is compiled, with its name and how many were before it; not where the driver
  // has it in a cache of its own, as far as the marks in ours tell.
  ProgramCache(cl::Context context, cl::Device device, DeviceInfo info,
               std::function<void(const std::string&, int)> on_compile);

  // A kernel of the caller's own, since one's arguments are set and used in two calls. Builds its program at first use.
  // Throws Error(compile) with the build log.
  cl::Kernel kernel(const std::string& file, const std::string& name, const std::string& defines);

 private:
  cl::Program& program(const std::string& file, const std::string& defines);
  cl::Program build(const std::string& file, const std::string& defines, bool from_source);
  bool build_from_disk(const std::string& key, const std::string& options, cl::Program& out) const;
  void save_to_disk(const std::string& key, const cl::Program& program) const;

  cl::Context context_;
  cl::Device device_;
  DeviceInfo info_;
  std::function<void(const std::string&, int)> on_compile_;
  std::mutex mutex_;
  DiskCache disk_;   // binaries, for drivers that keep none
  DiskCache marks_;  // of what a driver that keeps its own has compiled before
  std::map<std::string, cl::Program> programs_;
  std::set<std::string> from_disk_;  // of these
  int compiled_ = 0;
};

}  // namespace vsplat
