#include "carry_out.h"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "flags.h"

namespace command {
namespace {

constexpr int exit_failed = 1, exit_usage = 2;

int report(int code, const std::string& text) {
  clear_progress();
  std::fprintf(stderr, "vsplat: %s\n", for_terminal(text).c_str());
  return code;
}

// Flushes stdout and reports an error if output was lost.
int finish(int code) {
  const bool streamed = static_cast<bool>(std::cout.flush());
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && streamed) return code;
  const std::string reason = std::strerror(errno);
  return report(code == 0 ? exit_failed : code, "stdout: cannot be written: " + reason);
}

// Runs the command. Returns the exit code, signals aside.
int result_of(const Run& run) try {
  name_options();
  if (run) run();
  return 0;
} catch (const UsageError& e) {
  return report(exit_usage, e.what());
} catch (const vsplat::Error& e) {
  if (e.status() == VSPLAT_ERROR_CANCELLED) return report(exit_failed, "stopped; nothing was written");
  return report(e.status() == VSPLAT_ERROR_USAGE ? exit_usage : exit_failed, e.what());
} catch (const std::exception& e) {
  return report(exit_failed, e.what());
}

}  // namespace

int carry_out(CLI::App& app, const Run& run, const std::vector<std::string>& given) {
  catch_interrupts();
  try {
    // CLI11 takes the arguments in reverse order, without the program's name.
    std::vector<std::string> arguments = given;
    refuse_empty_values(arguments);
    arguments = with_values(app, with_names_of_here(app, with_joined_numbers(arguments)));
    if (arguments.empty()) arguments = {"--help"};
    std::reverse(arguments.begin(), arguments.end());
    app.parse(std::move(arguments));
  } catch (const CLI::Success& e) {  // --help, --version
    return finish(app.exit(e));
  } catch (const UsageError& e) {
    return report(exit_usage, e.what());
  } catch (const CLI::ParseError& e) {  // an unknown argument is the likelier cause, even if a required one is missing
    const std::string unknown = unknown_text(app);
    return report(exit_usage, (unknown.empty() ? e.what() : unknown) + "\nRun with --help for more.");
  }

  const int code = finish(result_of(run));  // output is flushed before leave_ranks() may end the process
  if (interrupted() && code == 0 && !stop_was_reported()) report(code, "asked to stop; what was begun is written");
  if (!interrupted()) leave_ranks(code);
  return interrupted() ? interrupt_code() : code;
}

}  // namespace command
