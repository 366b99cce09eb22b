// vsplat doctor: finds out why there is no device, or the wrong one, and what to do.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {
namespace {

struct DoctorOptions {
  Common common;
  double seconds = 20;
};

void doctor(const DoctorOptions& o) {
  set_up_library(o.common);
  vsplat_doctor_options options = VSPLAT_DOCTOR_OPTIONS_INIT;
  options.seconds = o.seconds;
  options.json = o.common.json;
  let_interrupts_end();
  const vsplat::Diagnosis found = vsplat::doctor(options);
  if (o.common.json)
    print_json(nlohmann::ordered_json::parse(found.text));
  else
    std::printf("%s", for_terminal(found.text).c_str());
  if (found.findings == 1) throw std::runtime_error("1 thing is wrong");
  if (found.findings > 1) throw std::runtime_error(std::to_string(found.findings) + " things are wrong");
}

}  // namespace

void add_doctor(CLI::App& app, Run& run) {
  auto o = std::make_shared<DoctorOptions>();
  CLI::App* sub =
      app.add_subcommand("doctor", "Explain why there is no OpenCL device, or the wrong one, and what to do");
  sub->add_option("--seconds", o->seconds, "Time limit for one driver to load and to list its devices (default: 20)")
      ->check(CLI::Range(0.1, 3600.0))
      ->type_name("S");
  add_common(*sub, o->common, {.device = false, .profile = false, .overwrite = false, .outside = false});
  sub->footer(
      "Each driver is examined in a process of its own, so a driver that crashes or hangs can be named. The exit\n"
      "code is 0 if a device can be used and nothing is wrong, else 1.\n"
      "Examples:\n"
      "  vsplat doctor\n"
      "  vsplat doctor --json");
  sub->callback([o, &run] { run = [o] { doctor(*o); }; });
}

}  // namespace command
