// vsplat report: writes one file with what is needed to find out what is wrong on a machine.
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "outputs.h"
#include "session.h"

namespace command {
namespace {

struct ReportOptions {
  Common common;
  std::string output = "vsplat-report.json";
  double seconds = 20;
  bool no_run = false;
};

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

// Whether this process would survive loading all drivers, as it does next.
bool may_open(const nlohmann::ordered_json& doctor) {
  for (const nlohmann::ordered_json& driver : doctor["drivers"])
    if (driver["state"] == "crashed" || driver["state"] == "hangs") return false;
  return doctor["usable"].get<bool>();
}

// Writes what is known without a device before opening one, since a driver may crash the process.
void report(const ReportOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.expect(o.output);
  vsplat_report_options options = VSPLAT_REPORT_OPTIONS_INIT;
  options.seconds = o.seconds;
  let_interrupts_end();
  const std::string before = vsplat::report(nullptr, options);
  catch_interrupts();
  write_text(outputs.begin(o.output), before);
  outputs.keep();
  const nlohmann::ordered_json doctor = nlohmann::ordered_json::parse(before)["doctor"];
  if (!may_open(doctor)) {
    warn("no device is opened: see `vsplat doctor`; the report has its findings");
  } else if (!o.no_run) {
    try {
      Session session(o.common);
      session.about("command", "report");
      session.about("model", model_name(""));
      session.start("standard run");
      options.progress = Session::on_progress;
      options.user = &session;
      const std::string whole = vsplat::report(session.device().get(), options);
      clear_progress();
      write_text(outputs.begin(o.output), whole);
      const nlohmann::ordered_json run = nlohmann::ordered_json::parse(whole)["run"];
      if (run.contains("error")) warn("the standard run failed: " + first_line(run["error"].get<std::string>()));
    } catch (const vsplat::Error& e) {
      if (e.status() == VSPLAT_ERROR_CANCELLED || e.status() == VSPLAT_ERROR_FILE) throw;
      warn(std::string("without a run: ") + e.what());
    }
  }
  outputs.commit();
  say(o.common,
      o.output + ": names of users, of the machine and of their folders are replaced; read it before you send it");
}

}  // namespace

void add_report(CLI::App& app, Run& run) {
  auto o = std::make_shared<ReportOptions>();
  CLI::App* sub = app.add_subcommand("report", "Write one file for a bug report");
  sub->add_option("-o,--output", o->output, "The file to write (default: vsplat-report.json)")->type_name("FILE.json");
  sub->add_option("--seconds", o->seconds, "Time limit for one driver to load and to list its devices (default: 20)")
      ->check(CLI::Range(0.1, 3600.0))
      ->type_name("S");
  sub->add_flag("--no-run", o->no_run, "Open no device, and leave out the standard run and its profile");
  add_common(*sub, o->common, {.profile = false, .json = false, .outside = false});
  sub->footer(
      "The report is JSON, which you can read before you send or paste it. Facts that need no device are written\n"
      "first, so they are there even if a driver ends the process.\n"
      "Examples:\n"
      "  vsplat report\n"
      "  vsplat report --output report.json --device gpu");
  sub->callback([o, &run] { run = [o] { report(*o); }; });
}

}  // namespace command
