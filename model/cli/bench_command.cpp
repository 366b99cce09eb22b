// vsplat bench: checks and times operations, drawing, the network, training and fitting. A program of its own does it,
// since it needs what the library does not export.
#include <vsplat/vsplat.h>

#include <memory>
#include <stdexcept>

#include "bench_options.h"
#include "command.h"
#include "runtime/library_programs.h"
#include "runtime/system/system_process.h"

namespace command {
namespace {

// Continues as the program, which gets the same arguments; returns only by an exception.
void become_bench(const std::vector<std::string>& arguments) {
  const std::string program =
      vsplat::library_program("vsplat-bench", reinterpret_cast<const void*>(&vsplat_version_string));
  if (interrupted()) throw std::runtime_error("stopped");
  const std::error_code error = vsplat::sys::become_program(program, arguments);
  throw std::runtime_error(program + ": cannot be started: " + error.message() +
                           "; `vsplat bench` is this program, which is installed with the command");
}

}  // namespace

void add_bench(CLI::App& app, Run& run, const std::vector<std::string>& arguments) {
  auto o = std::make_shared<BenchOptions>();
  CLI::App* sub = add_bench_options(app, *o);
  sub->callback([o, arguments, &run] { run = [o, arguments] { become_bench(arguments); }; });
}

}  // namespace command
