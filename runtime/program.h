// Kernel programs: embedded source -> includes expanded -> built with options -> cached in memory and, if the driver
// has no cache of its own, on disk.
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

// The names of all files of cl/ that the library carries, or that $VSPLAT_KERNEL_DIR contains, sorted; and the text of
// one.
std::vector<std::string> kernel_file_names();
std::string kernel_text(const std::string& name);

// The text of cl/<file>.cl with each `#include "x.clh"` replaced by the file (once each) and #line markers, so that
// build logs name the file and line. If $VSPLAT_KERNEL_DIR is set, it is read instead of the embedded files.
std::string expanded_source(const std::string& file);
// The build options of a program with these defines, without -DSUB_GROUP, which the build adds for devices that take it
// (cl/many_registers.clh).
std::string build_options(const std::string& defines);

// The programs of one opened device, shared by all of its streams. Thread-safe: one program is built at a time.
class ProgramCache {
 public:
  // `on_compile` is called before a program is compiled, with its name and how many were compiled before it. It is not
  // called if the driver's own cache has the program, as far as our markers show.
  ProgramCache(cl::Context context, cl::Device device, DeviceInfo info,
               std::function<void(const std::string&, int)> on_compile);

  // Returns a new kernel object for the caller: setting arguments and launching are two calls, so an object cannot be
  // shared. Builds the program at first use. Throws Error(compile) with the build log.
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
  DiskCache disk_;   // binaries, for drivers without a cache
  DiskCache marks_;  // markers: programs that a driver with a cache has compiled before
  std::map<std::string, cl::Program> programs_;
  std::set<std::string> from_disk_;  // keys in programs_ that were read from disk
  int compiled_ = 0;
};

}  // namespace vsplat
