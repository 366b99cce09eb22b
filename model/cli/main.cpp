// vsplat: the command line. Each sub-command has a file of its own; this one combines them and turns errors into exit
// codes: 0 on success, 1 if something failed, 2 if the request itself is wrong, 128 plus the signal's number if a
// signal stopped it.
#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "flags.h"

namespace {

constexpr int exit_failed = 1, exit_usage = 2;

int report(int code, const std::string& text) {
  command::clear_progress();
  std::fprintf(stderr, "vsplat: %s\n", command::for_terminal(text).c_str());
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
int result_of(const command::Run& run) try {
  if (run) run();
  return 0;
} catch (const command::UsageError& e) {
  return report(exit_usage, e.what());
} catch (const vsplat::Error& e) {
  if (e.status() == VSPLAT_ERROR_CANCELLED) return report(exit_failed, "stopped; nothing was written");
  return report(e.status() == VSPLAT_ERROR_USAGE ? exit_usage : exit_failed, command::with_flags(e.what()));
} catch (const std::exception& e) {
  return report(exit_failed, e.what());
}

}  // namespace

int main(int argc, char** argv) {
  command::catch_interrupts();
  CLI::App app("Turns posed photos into a 3D Gaussian splat, and draws it from anywhere, on any OpenCL device.",
               "vsplat");
  app.set_version_flag("-V,--version", std::string("vsplat ") + vsplat_version_string());
  app.require_subcommand(1);
  app.get_formatter()->column_width(38);
  app.footer(
      "Examples:\n"
      "  vsplat devices                                   what there is to compute on\n"
      "  vsplat doctor                                    why there is no device, and what to do\n"
      "  vsplat reconstruct photos/ --output scene.ply --render orbit:72 --turntable turn.webp\n"
      "  vsplat fit photos/ --start scene.ply --output sharp.ply\n"
      "  vsplat render scene.ply --cameras orbit:24 --images turn/ --size 640x480\n"
      "  vsplat-window scene.ply                          shows it, turned with the mouse (where SDL is installed)\n"
      "`vsplat help COMMAND` and `vsplat COMMAND --help` show all options of a command, with examples.");
  command::Run run;
  command::add_reconstruct(app, run);
  command::add_fit(app, run);
  command::add_render(app, run);
  command::add_scene_convert(app, run);
  command::add_init(app, run);
  command::add_weights(app, run);
  command::add_devices(app, run);
  command::add_doctor(app, run);
  command::add_report(app, run);
  command::add_kernels(app, run);
  command::add_tune(app, run);
  command::add_selftest(app, run);
  command::add_bench(app, run);
  command::add_profile(app, run);
  command::add_dataset(app, run);
  command::add_train(app, run);
  command::add_evaluate(app, run);
  command::add_help(app, run);
  command::add_completion(app, run);

  try {
    // CLI11 takes the arguments in reverse order, without the program's name.
    std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
    command::refuse_empty_values(arguments);
    arguments = command::with_names_of_here(app, command::with_joined_numbers(arguments));
    if (arguments.empty()) arguments = {"--help"};
    std::reverse(arguments.begin(), arguments.end());
    app.parse(std::move(arguments));
  } catch (const CLI::Success& e) {  // --help, --version
    return finish(app.exit(e));
  } catch (const command::UsageError& e) {
    return report(exit_usage, e.what());
  } catch (const CLI::ParseError& e) {  // an unknown argument is the likelier cause, even if a required one is missing
    const std::string unknown = command::unknown_text(app);
    return report(exit_usage, (unknown.empty() ? e.what() : unknown) + "\nRun with --help for more.");
  }

  const int code = finish(result_of(run));  // output is flushed before leave_ranks() may end the process
  if (command::interrupted() && code == 0 && !command::stop_is_told())
    report(code, "asked to stop; what was begun is written");
  if (!command::interrupted()) command::leave_ranks(code);
  return command::interrupted() ? command::interrupt_code() : code;
}
