// vsplat selftest: checks that a device computes correctly, kernel by kernel, and switches off what does not.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "isolated.h"

namespace command {
namespace {

using Json = nlohmann::ordered_json;

struct SelftestOptions {
  Common common;
  bool quick = false, forget = false;
  double patience = 300;
};

struct Shown {
  const Common& common;
  double started = 0;
  bool compiled = false;
  Patience patience;
};

int32_t on_progress(void* user, const char* stage, double done) {
  auto* shown = static_cast<Shown*>(user);
  shown->patience.heard();
  if (interrupted()) return 0;
  show_progress(shown->common, "self-test: " + std::string(stage) + ", " +
                                   std::to_string(static_cast<int>(100 * done)) + " %, " +
                                   seconds_text(elapsed_seconds() - shown->started));
  return 1;
}

void on_compile(void* user, const char* kernel, int32_t compiled) {
  auto* shown = static_cast<Shown*>(user);
  shown->patience.heard();
  if (!shown->compiled) say(shown->common, "preparing kernels; a device's first run takes longest");
  shown->compiled = true;
  show_progress(shown->common, "preparing kernels: " + std::to_string(compiled + 1) + " (" + kernel + ")");
}

std::string figure(const Json& value) {
  if (value.is_null()) return "no number";
  char text[32];
  std::snprintf(text, sizeof text, "%.2g", value.get<double>());
  return text;
}

// A verdict in words, in one line.
std::string verdict_line(const Json& report) {
  std::string out = report["device"].get<std::string>() + ", driver " + report["driver"].get<std::string>() + ": " +
                    report["verdict"].get<std::string>();
  if (report["verdict"] == "degraded") out += "; not used from now on: " + report["off_in_words"].get<std::string>();
  if (report["verdict"] != "ok") out += "; " + report["worst"].get<std::string>();
  return out;
}

void print_flavour(const Json& flavour, bool all) {
  std::size_t wrong = 0;
  for (const Json& k : flavour["kernels"]) wrong += k["verdict"] != "ok";
  std::printf("%s kernels: %zu with their options, %d results, %zu kernels wrong or in doubt%s\n",
              flavour["flavour"].get<std::string>().c_str(), flavour["kernels"].size(), flavour["results"].get<int>(),
              wrong, flavour["usable"].get<bool>() ? "" : "; not usable");
  std::printf("  %-36s %-8s %8s %10s %10s  %-26s %s\n", "kernel", "verdict", "results", "error", "allowed", "options",
              "worst result");
  for (const Json& k : flavour["kernels"]) {
    if (!all && k["verdict"] == "ok") continue;
    std::printf("  %-36s %-8s %8d %10s %10s  %-26s %s\n", k["kernel"].get<std::string>().c_str(),
                k["verdict"].get<std::string>().c_str(), k["results"].get<int>(), figure(k["error"]).c_str(),
                figure(k["tolerance"]).c_str(), k["options"].get<std::string>().c_str(),
                for_terminal(k["what"].get<std::string>()).c_str());
  }
  for (const Json& one : flavour["tuned"])
    if (all || !one["right"].get<bool>())
      std::printf("  %-36s %-8s %8d %10s %10d  %s\n", "tuned", one["right"].get<bool>() ? "ok" : "wrong", 1,
                  figure(one["error"]).c_str(), 1, for_terminal(one["what"].get<std::string>()).c_str());
  for (const Json& name : flavour["untested"]) std::printf("  %-36s untested\n", name.get<std::string>().c_str());
}

void selftest(const SelftestOptions& o) {
  const std::string ended = in_another_process(o.common, "self-test");  // before any driver is loaded
  set_up_library(o.common);
  Shown shown{o.common, elapsed_seconds(), false, {}};
  shown.patience.begin(o.patience);
  vsplat_selftest_options options = VSPLAT_SELFTEST_OPTIONS_INIT;
  options.device = o.common.device.c_str();
  options.quick = o.quick;
  options.forget = o.forget;
  options.progress = on_progress;
  options.on_compile = on_compile;
  options.user = &shown;
  options.ended = ended.c_str();
  vsplat_fitness fitness = VSPLAT_FITNESS_OK;
  const Json report = Json::parse(vsplat::selftest(options, fitness));
  clear_progress();
  if (o.common.json) {
    say(o.common, verdict_line(report));
    print_json(report);
  } else {
    for (const Json& flavour : report["flavours"]) print_flavour(flavour, !o.common.quiet);
    std::printf("%s\n", for_terminal(verdict_line(report)).c_str());
  }
  if (report["remembered"] == "before")
    warn("an earlier self-test found worse, and its verdict stays: run it without --quick to replace it");
  if (fitness == VSPLAT_FITNESS_UNUSABLE)
    throw std::runtime_error(for_terminal(verdict_line(report)) + ": take another device or another driver");
}

}  // namespace

void add_selftest(CLI::App& app, Run& run) {
  auto o = std::make_shared<SelftestOptions>();
  CLI::App* sub = app.add_subcommand("selftest", "Test whether a device computes correctly, kernel by kernel");
  sub->add_option("-d,--device", o->common.device,
                  "OpenCL device: index, platform:device, cpu, gpu, or part of a name (`vsplat devices` lists them)")
      ->type_name("DEVICE");
  sub->add_flag("--quick", o->quick, "Test fewer sizes of everything");
  sub->add_flag("--forget", o->forget, "Do not store the result");
  sub->add_option("--patience", o->patience,
                  "Time without progress after which a device counts as hanging (default: 300)")
      ->type_name("SECONDS")
      ->check(CLI::Range(1.0, 1e6));
  add_common(*sub, o->common, {.device = false, .profile = false, .overwrite = false, .outside = false});
  sub->footer(
      "Every kernel of both flavours and the network's stages run twice on generated numbers and are compared with\n"
      "scalar implementations. For this device, driver and version, wrong kernels are switched off if there is an\n"
      "alternative; other commands say so in their first line. If there is none, they refuse the device, except with\n"
      "VSPLAT_SELFTEST=ignore. The tests run in a process of their own: if a driver crashes it or hangs, the current\n"
      "test counts as wrong, and the others continue. Exit code 1: unusable.\n"
      "Examples:\n"
      "  vsplat selftest\n"
      "  vsplat selftest -d gpu --quick\n"
      "  vsplat selftest --json > selftest.json");
  sub->callback([o, &run] { run = [o] { selftest(*o); }; });
}

}  // namespace command
