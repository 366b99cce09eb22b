// What the sub-commands share: their options, the device they open, what they print, and when they stop.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <stdexcept>
#include <string>

namespace command {

// A request that cannot be served as it stands (exit code 2). Everything else that goes wrong ends with 1.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Options that sub-commands share.
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

// A check of values that says nothing of itself in --help, where the type's name tells.
CLI::Validator one_of(const std::vector<std::string>& values);

// Which of them a sub-command takes: those that do something there, besides --quiet and --verbose.
struct Takes {
  bool device = true, profile = true, json = true, overwrite = true, outside = true, precision = false;
};
void add_common(CLI::App& app, Common& common, const Takes& takes = {});

// Whether times were asked for, by --profile or --trace.
bool wants_times(const Common& common);

// UsageError where a run that computes nothing was asked for times.
void refuse_profile_of_dry_run(const Common& common);

// Which process of those that mpirun started this is. Rank 0 of 1 where it did not.
struct Ranks {
  int32_t rank = 0, count = 1;
  bool several() const { return count > 1; }
  bool leads() const { return rank == 0; }
};
// Joins the others; those but rank 0 say nothing but warnings from here on, each beginning with its rank.
Ranks join_ranks(Common& common);
// Ends the others where this one fails.
void leave_ranks(int exit_code);

// What holds for the whole library: its messages go to stderr, as much of them as asked for; where files may lie that
// others name; how much of the host's memory may be used.
void set_up_library(const Common& common);

// Text that may hold what a stranger wrote (names in files, paths), for a terminal: control characters but line ends
// and tabs, and what is no UTF-8 become ?.
std::string for_terminal(const std::string& text);
// JSON with such characters escaped, which means the same.
std::string json_for_terminal(const std::string& json);

// What --json asks for, on stdout; what of it is no UTF-8, paths for instance, becomes U+FFFD.
void print_json(const nlohmann::ordered_json& value);

// One line on stderr, unless --quiet. Whatever progress is shown is taken away before it.
void say(const Common& common, const std::string& text);

// The same with "warning: " before it, whatever is asked for.
void warn(const std::string& text);

// On a terminal a line that is written over; otherwise nothing.
void show_progress(const Common& common, const std::string& text);
bool progress_is_shown();  // whether it is now
void clear_progress();

// "3.4 s", "2 min 05 s"; "1.20 GiB", "35 MiB".
std::string seconds_text(double seconds);
std::string bytes_text(std::uint64_t bytes);

// Since the program started.
double elapsed_seconds();

// Interrupts (SIGINT, SIGTERM, SIGHUP where it is not ignored) ask for a clean stop; a second one ends at once. A file
// beyond its limit and a pipe that nobody reads are errors of the write.
void catch_interrupts();
// From now on each of them ends the program at once: where nothing is written yet, and a call knows no stop.
void let_interrupts_end();
bool interrupted();
// A stop that the command has answered by writing what it had; `text` is the line that tells of it.
void tell_stop(const Common& common, const std::string& text);
bool stop_is_told();
int interrupt_code();  // what a shell tells of it: 130, 143, 129

// Each adds its sub-command with everything it needs; `run` is set when it was asked for and does the work.
using Run = std::function<void()>;
void add_devices(CLI::App& app, Run& run);
void add_doctor(CLI::App& app, Run& run);
void add_kernels(CLI::App& app, Run& run);
void add_selftest(CLI::App& app, Run& run);
void add_init(CLI::App& app, Run& run);
void add_weights(CLI::App& app, Run& run);
void add_reconstruct(CLI::App& app, Run& run);
void add_refine(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_scene_convert(CLI::App& app, Run& run);  // convert
void add_bench(CLI::App& app, Run& run);
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
