// An open device, or several that share the work, with what the user sees of it: the line that names it, progress, and
// the profile at the end.
#pragma once
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"

namespace command {

// How many devices a command can use at once.
enum class Devices { one, several };

class Session {
 public:
  explicit Session(const Common& common, Devices most = Devices::one);
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  const vsplat::Device& device() const { return devices_.front(); }
  const std::vector<vsplat::Device>& devices() const { return devices_; }
  // For an evaluation or a training by all of them; they stay this session's.
  template <class Options>
  void share(Options& options) const {
    options.more_devices = handles_.data() + 1;
    options.num_more_devices = handles_.size() - 1;
  }
  // For the progress fields of options structs: shows the stage with times, and stops where the user interrupts. From
  // any thread.
  static int32_t on_progress(void* session, const char* stage, double done);
  // What the work is called in the next progress lines, and when it began.
  void start(const std::string& what);
  // What the numbers of a result depend on: "tuning", the hash of the table of tuned parameters, null without one, of
  // several devices that differ a list; "precision", and in mixed
  // precision "matrix_unit".
  void add_numerics(nlohmann::ordered_json& out) const;
  // Names what its profile is of: ("model", "m.safetensors").
  void about(const std::string& what, const std::string& name) { devices_.front().profile_name(what, name); }
  // Writes --profile and --trace, and the table to stderr with --verbose. The recording ends with that: when all else
  // is written.
  void write_profile(Outputs& outputs);

 private:
  static void on_compile(void* session, const char* kernel, int32_t compiled);
  vsplat_device_options options(const std::string& device);

  const Common& common_;
  std::mutex mutex_;  // of what follows, where several devices work
  std::string what_, stage_;
  double started_ = 0, last_line_ = 0;
  bool compiled_ = false, recorded_ = false;
  std::vector<vsplat::Device> devices_;
  std::vector<vsplat_device> handles_;
};

// The model of --model; where the option is not given, the one that the library carries.
vsplat::Model load_model(const std::string& path);
// What profiles call it.
std::string model_name(const std::string& path);

// What the command holds of the host's memory beside what the library plans.
void add_host_memory(vsplat_plan& plan, uint64_t bytes, const vsplat::Device& device);

// A table, or JSON with --json, of what a computation needs against what there is.
struct Plan {
  std::string title;
  vsplat_plan plan;
};
void print_plans(const Common& common, const std::vector<Plan>& plans);

}  // namespace command
