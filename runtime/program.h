// Kernel programs: embedded source -> includes expanded -> built with options -> kept in memory and, where the driver
// keeps none of its own, on disk.
#pragma once
#include <functional>
#include <map>
#include <set>
#include <string>

#include "runtime/device.h"
#include "runtime/disk_cache.h"
#include "runtime/opencl.h"

namespace vsplat {

// The text of cl/<file>.cl with `#include "x.clh"` replaced by the file (each once) and #line markers, so that build
// logs name the file and line. $VSPLAT_KERNEL_DIR, where set, is read instead of what is embedded.
std::string expanded_source(const std::string& file);

class ProgramCache {
 public:
  ProgramCache(cl::Context context, cl::Device device, DeviceInfo info);

  // Called before a program is compiled, with its name and how many were before it; not where the driver has it in a
  // cache of its own, as far as the marks in ours tell.
  std::function<void(const std::string&, int)> on_compile;

  // Builds at first use. Throws Error(compile) with the build log.
  cl::Kernel& kernel(const std::string& file, const std::string& name, const std::string& defines);
  double build_seconds() const { return build_seconds_; }

 private:
  cl::Program& program(const std::string& file, const std::string& defines);
  cl::Program build(const std::string& file, const std::string& defines, bool from_source);
  cl::Kernel kernel_of(const std::string& file, const std::string& name, const std::string& defines);
  bool build_from_disk(const std::string& key, const std::string& options, cl::Program& out) const;
  void save_to_disk(const std::string& key, const cl::Program& program) const;

  cl::Context context_;
  cl::Device device_;
  DeviceInfo info_;
  DiskCache disk_;   // binaries, for drivers that keep none
  DiskCache marks_;  // of what a driver that keeps its own has compiled before
  std::map<std::string, cl::Program> programs_;
  std::set<std::string> from_disk_;  // of these
  std::map<std::string, cl::Kernel> kernels_;
  int compiled_ = 0;
  double build_seconds_ = 0;
};

}  // namespace vsplat
