#include "command.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "outputs.h"
#include "runtime/printable.h"
#include "runtime/system/system.h"

namespace command {
namespace {

const auto start_time = std::chrono::steady_clock::now();
std::atomic<int> stop_asked = 0;
bool stop_reported = false;
std::atomic<bool> progress_shown = false;
Ranks joined_ranks;
int log_threshold = VSPLAT_LOG_INFO;

void on_signal(int number) { stop_asked = number; }

void on_log(void*, vsplat_log_level level, const char* text) {
  if (static_cast<int>(level) > log_threshold) return;
  clear_progress();
  std::fprintf(stderr, "%s%s\n", level == VSPLAT_LOG_WARNING ? "warning: " : "", for_terminal(text).c_str());
}

void add_precision(CLI::App& app, Common& common, bool automatic) {
  std::vector<std::string> values = {"fp32", "mixed"};
  std::string text = "Precision of large matrix products: mixed rounds the factors to bf16, for matrix units";
  if (automatic) {
    values.emplace_back("auto");
    text += "; auto does so where a self-test (`vsplat selftest`) has found the result as good";
  }
  app.add_option("--precision", common.precision, text)
      ->check(one_of(values))
      ->type_name(automatic ? "fp32|mixed|auto" : "fp32|mixed");
}

void add_device_options(CLI::App& app, Common& common, const Takes& takes) {
  const OptionGroup in(app, "Device");
  app.add_option(
         "-d,--device", common.device,
         "OpenCL device: index, platform:device, cpu|gpu|acc, or part of its name (default: $VSPLAT_DEVICE, else "
         "the first GPU, else the first device); render, evaluate, train and reconstruct --list take several, \"0,1\" "
         "or all")
      ->type_name("DEVICE");
  app.add_option("--kernels", common.kernels, "Flavour of the dense kernels (default: $VSPLAT_KERNELS, else by device)")
      ->check(one_of({"auto", "cpu", "gpu"}))
      ->type_name("auto|cpu|gpu");
  app.add_option("--gemm", common.gemm,
                 "Implementation of matrix products: CLBlast, or vsplat's own, which auto takes (default: auto)")
      ->check(one_of({"auto", "own", "clblast"}))
      ->type_name("auto|own|clblast");
  if (takes.precision) add_precision(app, common, takes.automatic_precision);
  app.add_option("--max-memory", common.max_memory, "Device memory to use at most (default: what the device reports)")
      ->check(positive())
      ->type_name("GiB");
}

}  // namespace

CLI::Validator one_of(const std::vector<std::string>& values) { return CLI::IsMember(values).description(""); }

void add_common(CLI::App& app, Common& common, const Takes& takes) {
  if (takes.device) add_device_options(app, common, takes);
  const OptionGroup in(app, "Messages and files");
  if (takes.outside)
    app.add_option("--max-host-memory", common.max_host_memory,
                   "Host memory to use at most (default: three quarters of the free memory)")
        ->check(positive())
        ->type_name("GiB")
        ->group(takes.device ? "Device" : "Messages and files");
  common.takes_profile = takes.profile;
  if (takes.profile) {
    app.add_option("--profile", common.profile,
                   "Write a profile: the time of every kernel and of the host, as JSON or as a page")
        ->type_name("FILE.json|.html");
    app.add_option("--trace", common.trace, "Write a timeline for chrome://tracing or ui.perfetto.dev")
        ->type_name("FILE");
  }
  if (takes.outside)
    app.add_flag("--allow-outside", common.allow_outside,
                 "Read pictures, masks, textures and buffers that files name wherever they are, not only in the files' "
                 "folder");
  if (takes.json) app.add_flag("--json", common.json, "Print results as JSON on stdout");
  if (takes.overwrite) app.add_flag("-w,--overwrite", common.overwrite, "Replace existing files");
  app.add_flag("-q,--quiet", common.quiet, "Print only warnings and errors");
  app.add_flag("-v,--verbose", common.verbose, "Also print details");
}

bool wants_times(const Common& common) { return !common.profile.empty() || !common.trace.empty(); }

void refuse_profile_of_dry_run(const Common& common) {
  for (const auto& [option, path] : {std::pair{"--profile", &common.profile}, {"--trace", &common.trace}})
    if (!path->empty()) throw UsageError(std::string(option) + " has nothing to time with --dry-run: give one of them");
}

Ranks join_ranks(Common& common) {
  vsplat::check(vsplat_ranks_join(&joined_ranks.rank, &joined_ranks.count));
  if (!joined_ranks.leads()) {
    common.quiet = true, common.json = false;
    log_threshold = VSPLAT_LOG_WARNING;
  }
  return joined_ranks;
}

void leave_ranks(int exit_code) {
  if (joined_ranks.several() && exit_code != 0) vsplat_ranks_abort(exit_code);
}

void set_up_library(const Common& common) {
  log_threshold = common.quiet ? VSPLAT_LOG_WARNING : common.verbose ? VSPLAT_LOG_VERBOSE : VSPLAT_LOG_INFO;
  vsplat_log_set(on_log, nullptr);
  allow_outside(common.allow_outside);
  constexpr double most_gib = 1u << 30;  // more than any machine has
  vsplat::check(vsplat_set_host_memory(
      static_cast<uint64_t>(std::min(common.max_host_memory, most_gib) * static_cast<double>(1u << 30))));
  if (wants_times(common) || (common.verbose && common.takes_profile))
    vsplat::check(vsplat_profile_begin(elapsed_seconds()));
}

namespace {

// Copies printable characters, and replaces the others by what `replaced` returns.
std::string shown(const std::string& text, const std::function<std::string(const vsplat::Character&)>& replaced) {
  std::string out;
  for (std::size_t at = 0; at < text.size();) {
    const vsplat::Character c = vsplat::character_at(std::string_view(text).substr(at));
    out += c.seen || c.code == '\n' || c.code == '\t' ? text.substr(at, c.bytes) : replaced(c);
    at += c.bytes;
  }
  return out;
}

// As a JSON escape, in UTF-16.
std::string escaped(const vsplat::Character& c) {
  char out[16];
  const auto code = static_cast<unsigned>(c.code);
  if (code < 0x10000)
    std::snprintf(out, sizeof out, "\\u%04x", code);
  else
    std::snprintf(out, sizeof out, "\\u%04x\\u%04x", 0xd7c0 + (code >> 10), 0xdc00 + (code & 0x3ff));
  return out;
}

}  // namespace

std::string for_terminal(const std::string& text) {
  return shown(text, [](const vsplat::Character&) { return "?"; });
}

std::string json_for_terminal(const std::string& json) { return shown(json, escaped); }

void print_json(const nlohmann::ordered_json& value) {
  const std::string text = value.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::printf("%s\n", json_for_terminal(text).c_str());
}

void say(const Common& common, const std::string& text) {
  if (common.quiet) return;
  clear_progress();
  std::fprintf(stderr, "%s\n", for_terminal(text).c_str());
}

void warn(const std::string& text) {
  clear_progress();
  std::fprintf(stderr, "warning: %s\n", for_terminal(text).c_str());
}

void show_progress(const Common& common, const std::string& text) {
  static const bool terminal = vsplat::sys::error_output_is_terminal();
  if (common.quiet || !terminal) return;
  std::fprintf(stderr, "\r\033[K%s", for_terminal(text).c_str());
  std::fflush(stderr);
  progress_shown = true;
}

bool progress_is_shown() { return progress_shown; }

void clear_progress() {
  if (!progress_shown) return;
  std::fprintf(stderr, "\r\033[K");
  std::fflush(stderr);
  progress_shown = false;
}

std::string seconds_text(double seconds) {
  char text[64];
  if (seconds < 60)
    std::snprintf(text, sizeof text, "%.1f s", seconds);
  else if (seconds < 3600)
    std::snprintf(text, sizeof text, "%d min %02d s", static_cast<int>(seconds) / 60, static_cast<int>(seconds) % 60);
  else if (seconds < 86400)
    std::snprintf(text, sizeof text, "%d h %02d min", static_cast<int>(seconds) / 3600,
                  static_cast<int>(seconds) / 60 % 60);
  else
    std::snprintf(text, sizeof text, "%.1f days", seconds / 86400);
  return text;
}

std::string bytes_text(std::uint64_t bytes) {
  char text[64];
  const double mib = static_cast<double>(bytes) / (1 << 20);
  if (mib < 1000)
    std::snprintf(text, sizeof text, mib < 10 ? "%.2f MiB" : "%.0f MiB", mib);
  else
    std::snprintf(text, sizeof text, "%.2f GiB", mib / 1024);
  return text;
}

double elapsed_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();
}

void catch_interrupts() {
  // After a signal, a failing write reports the error, and all that was begun is removed.
  vsplat::sys::catch_stops(on_signal);
  vsplat::sys::tell_of_faults("");  // before drivers install handlers, which then call these
}

void let_interrupts_end() { vsplat::sys::let_stops_end(); }

bool interrupted() { return stop_asked != 0; }

void tell_stop(const Common& common, const std::string& text) {
  say(common, text);
  stop_reported = !common.quiet;
}

bool stop_was_reported() { return stop_reported; }

int interrupt_code() { return 128 + stop_asked; }

}  // namespace command
