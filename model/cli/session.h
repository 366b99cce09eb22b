// One or several open devices that share the work, with what the user sees: the line that names them, progress, and the
// profile at the end.
#pragma once
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <optional>
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
  // Sets the fields for an evaluation or a training by all devices, which this session keeps.
  template <class Options>
  void share(Options& options) const {
    options.more_devices = handles_.data() + 1;
    options.num_more_devices = handles_.size() - 1;
  }
  // For the progress fields of options structs: shows the stage with times, and stops if the user interrupts. Called
  // from any thread.
  static int32_t on_progress(void* session, const char* stage, double done);
  bool recorded() const { return recorded_; }  // whether a profile is being recorded
  // Names the work in the following progress lines, and starts its clock.
  void start(const std::string& what);
  // Adds what the numbers of a result depend on: "tuning", the hash of the table of tuned parameters (null without one;
  // a list if several devices differ); "precision", and in mixed precision "matrix_unit".
  void add_numerics(nlohmann::ordered_json& out) const;
  // Sets the profile's subject: ("model", "m.safetensors").
  void about(const std::string& what, const std::string& name) { devices_.front().profile_name(what, name); }
  // Writes --profile and --trace, and with --verbose the table to stderr. This ends the recording, so call it after all
  // else is written.
  void write_profile(Outputs& outputs);

 private:
  static void on_compile(void* session, const char* kernel, int32_t compiled);
  vsplat_device_options options(const std::string& device);

  const Common& common_;
  std::mutex mutex_;  // guards the members below when several devices work
  std::string what_, stage_;
  double started_ = 0, last_line_ = 0;
  bool compiled_ = false, recorded_ = false;
  std::vector<vsplat::Device> devices_;
  std::vector<vsplat_device> handles_;
};

// The model of --model; the built-in model if the option is not given.
vsplat::Model load_model(const std::string& path);
// The model's name in profiles.
std::string model_name(const std::string& path);

// Adds the command's own host memory to the library's plan.
void add_host_memory(vsplat_plan& plan, uint64_t bytes, const vsplat::Device& device);

// How long a number of steps takes.
struct PlannedTime {
  std::int64_t steps = 0;  // 0: found out by the fit
  double seconds = 0;
};
struct Plan {
  std::string title;
  vsplat_plan plan;
  std::optional<PlannedTime> time{};
};
// A table, or JSON with --json, that compares needed with available memory.
void print_plans(const Common& common, const std::vector<Plan>& plans);

}  // namespace command
