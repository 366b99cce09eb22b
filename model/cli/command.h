// What the sub-commands share: options, opening a device, printing, and stopping.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace command {

// A request that cannot be served as given (exit code 2). All other errors exit with 1.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Options shared by sub-commands.
struct Common {
  std::string device;
  std::string kernels = "auto";
  std::string gemm = "auto";
  std::string precision = "fp32";
  double max_memory = 0, max_host_memory = 0;  // GiB
  std::string profile, trace;
  bool takes_profile = false;
  bool allow_outside = false, json = false, overwrite = false, quiet = false, verbose = false;
};

// Options that are added to `app` during its lifetime stand in this group of --help.
class OptionGroup {
 public:
  OptionGroup(CLI::App& app, const std::string& name) : app_(app), before_(app.option_defaults()->get_group()) {
    app_.option_defaults()->group(name);
  }
  ~OptionGroup() { app_.option_defaults()->group(before_); }
  OptionGroup(const OptionGroup&) = delete;
  OptionGroup& operator=(const OptionGroup&) = delete;

 private:
  CLI::App& app_;
  std::string before_;
};

// A check of values that adds nothing to --help, where the type's name already lists them.
CLI::Validator one_of(const std::vector<std::string>& values);

// Which common options a sub-command takes besides --quiet and --verbose: those that have an effect there.
struct Takes {
  bool device = true, profile = true, json = true, overwrite = true, outside = true, precision = false;
  bool automatic_precision = false;  // whether --precision takes auto, too
};
void add_common(CLI::App& app, Common& common, const Takes& takes = {});

// Whether --profile or --trace was given.
bool wants_times(const Common& common);

// UsageError if a run that computes nothing was asked for times.
void refuse_profile_of_dry_run(const Common& common);

// This process among those that mpirun started; rank 0 of 1 without mpirun.
struct Ranks {
  int32_t rank = 0, count = 1;
  bool several() const { return count > 1; }
  bool leads() const { return rank == 0; }
};
// Joins the other ranks. From then on, ranks other than 0 print only warnings, each beginning with the rank.
Ranks join_ranks(Common& common);
// Ends the other ranks when this one fails.
void leave_ranks(int exit_code);

// Sets up the library for the process: its messages go to stderr at the requested level; where files named by other
// files may lie; the limit of host memory.
void set_up_library(const Common& common);

// Escapes untrusted text (names in files, paths) for a terminal: control characters except line breaks and tabs, and
// invalid UTF-8, become ?.
std::string for_terminal(const std::string& text);
// JSON with those characters escaped; its meaning is unchanged.
std::string json_for_terminal(const std::string& json);

// Prints --json output on stdout; invalid UTF-8, in paths for instance, becomes U+FFFD.
void print_json(const nlohmann::ordered_json& value);

// Prints one line on stderr, unless --quiet. Removes a progress line first.
void say(const Common& common, const std::string& text);

// Like say(), with "warning: " before the text, and also with --quiet.
void warn(const std::string& text);

// Shows a line that is overwritten on a terminal; does nothing elsewhere.
void show_progress(const Common& common, const std::string& text);
bool progress_is_shown();  // whether a progress line is visible now
void clear_progress();

// "3.4 s", "2 min 05 s"; "1.20 GiB", "35 MiB".
std::string seconds_text(double seconds);
std::string bytes_text(std::uint64_t bytes);

// Time since the program started.
double elapsed_seconds();

// Makes interrupts (SIGINT, SIGTERM, and SIGHUP unless ignored) ask for a clean stop; a second one ends the program at
// once. A file beyond its size limit, and a pipe without a reader, become errors of the write.
void catch_interrupts();
// Makes interrupts end the program at once: for a time when nothing is written yet and a call cannot be stopped.
void let_interrupts_end();
bool interrupted();
// Reports a stop that the command has handled by writing what it had; `text` is the line printed.
void tell_stop(const Common& common, const std::string& text);
bool stop_was_reported();
int interrupt_code();  // exit code that a shell uses for the signal: 130, 143, 129

// Each adds its sub-command with its options. When the sub-command is given, `run` is set to the function that does the
// work.
using Run = std::function<void()>;
void add_devices(CLI::App& app, Run& run);
void add_doctor(CLI::App& app, Run& run);
void add_kernels(CLI::App& app, Run& run);
void add_selftest(CLI::App& app, Run& run);
void add_init(CLI::App& app, Run& run);
void add_weights(CLI::App& app, Run& run);
void add_poses(CLI::App& app, Run& run);
void add_reconstruct(CLI::App& app, Run& run);
void add_fit(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_view(CLI::App& app, Run& run);
void add_scene_convert(CLI::App& app, Run& run);                                     // convert
void add_scene_info(CLI::App& app, Run& run);                                        // info
void add_mesh(CLI::App& app, Run& run);                                              // mesh
void add_bench(CLI::App& app, Run& run, const std::vector<std::string>& arguments);  // as given to the program
void add_profile(CLI::App& app, Run& run);
void add_dataset(CLI::App& app, Run& run);
void add_train(CLI::App& app, Run& run);
void add_tune(CLI::App& app, Run& run);
void add_info_action(CLI::App& dataset, Run& run);  // of dataset
void add_report(CLI::App& app, Run& run);
void add_evaluate(CLI::App& app, Run& run);
void add_help(CLI::App& app, Run& run);
void add_completion(CLI::App& app, Run& run);

}  // namespace command
