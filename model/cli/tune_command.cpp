// vsplat tune: finds the fastest variants of the kernels on a device, and stores them for every later run.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "command.h"
#include "job_names.h"
#include "outputs.h"
#include "session.h"

namespace command {
namespace {

using Json = nlohmann::ordered_json;

struct TuneOptions {
  Common common;
  std::string model, jobs = "reconstruct,render", output;
  double seconds = 0;
  bool quick = false, full = false, again = false;
};

// "gemm m=4096 n=768 k=768 taps=1"
std::string words_of(const Json& named) {
  std::string out;
  for (const auto& [name, value] : named.items()) out += (out.empty() ? "" : " ") + name + "=" + value.dump();
  return out;
}

// Why a set was refused.
std::string reason_of(const Json& one) {
  const bool wrong = one["verdict"] == "wrong";
  if (wrong && one["error"].is_number()) return "wrong: off by " + one["error"].dump() + " of the largest value";
  const std::string why = one["why"].is_string() ? one["why"].get<std::string>() : "";
  if (wrong) return "wrong: " + (why.empty() ? "some values are no numbers" : why);
  return why.empty() ? "it does not run" : why;
}

void print_tuned(const Json& result) {
  for (const Json& one : result["chosen"]) {
    const std::string op = one["op"], shape = words_of(one["shape"]), set = words_of(one["set"]);
    std::printf("%-20s %-40s %-32s ", op.c_str(), shape.c_str(), set.c_str());
    if (one["times_as_fast"].is_number())
      std::printf("%5.2f times as fast\n", one["times_as_fast"].get<double>());
    else
      std::printf("as before, not timed again\n");
  }
  for (const Json& one : result["refused"]) {
    const std::string op = one["op"], shape = words_of(one["shape"]), set = words_of(one["set"]);
    std::printf("%-20s %-40s %-32s refused, %s\n", op.c_str(), shape.c_str(), set.c_str(),
                for_terminal(reason_of(one)).c_str());
  }
  const std::string table = result["table"];
  if (table.empty())
    std::printf("the defaults are the best that was tried\n");
  else
    std::printf("table %s: %s\n", table.substr(0, 12).c_str(), for_terminal(result["path"]).c_str());
}

std::string text_of_search(const Session& session, const vsplat::Model& model, const vsplat_tune_options& options) try {
  return session.device().tune(model.get(), options);
} catch (const vsplat::Error& e) {
  if (e.status() != VSPLAT_ERROR_CANCELLED) throw;
  throw std::runtime_error("stopped; what was tried is kept, and another run continues from there");
}

void tune(const TuneOptions& o) {
  set_up_library(o.common);
  if (o.quick && o.full) throw UsageError("--quick and --full: one of them");
  if (o.full && o.seconds > 0) throw UsageError("--seconds needs --quick: --full has no time limit");
  const vsplat::Model model = load_model(o.model);
  Session session(o.common);
  vsplat_tune_options options = VSPLAT_TUNE_OPTIONS_INIT;
  options.jobs = jobs_of("--for", o.jobs);
  options.full = o.full;
  options.again = o.again;
  options.seconds = o.seconds;
  options.path = o.output.empty() ? nullptr : o.output.c_str();
  options.progress = Session::on_progress;
  options.user = &session;
  session.start("tune");
  const Json result = Json::parse(text_of_search(session, model, options));
  clear_progress();
  const auto tried = result["tried"].get<long>(), left = result["left"].get<long>();
  say(o.common, std::to_string(tried) + " sets tried in " + seconds_text(result["seconds"]) +
                    (left > 0 ? "; " + std::to_string(left) +
                                    " more are left for another run, since time or memory did not suffice"
                              : ""));
  if (o.common.json)
    print_json(result);
  else
    print_tuned(result);
  if (!result["not_right"].empty())
    throw std::runtime_error(std::to_string(result["not_right"].size()) +
                             " operations have no set of parameters that is right on this device, the first: " +
                             result["not_right"][0].get<std::string>());
}

}  // namespace

void add_tune(CLI::App& app, Run& run) {
  auto o = std::make_shared<TuneOptions>();
  CLI::App* sub = app.add_subcommand("tune", "Find a device's fastest kernels, and use them from then on");
  sub->add_flag("--quick", o->quick,
                "About a minute: the slowest operations first, one parameter at a time (the default)");
  sub->add_flag("--full", o->full, "All combinations of values, for as long as it takes");
  sub->add_option("--seconds", o->seconds, "Time after which --quick begins nothing new (default: 50)")
      ->check(positive())
      ->type_name("S");
  sub->add_flag("--again", o->again, "Also repeat what was tried before");
  sub->add_option("--model", o->model, "The model whose sizes are tuned for (default: the built-in model)")
      ->type_name("MODEL.safetensors");
  sub->add_option("--for", o->jobs,
                  "Jobs whose sizes are tuned for, of reconstruct,render,fit,train (default: reconstruct,render)")
      ->type_name("JOBS");
  sub->add_option("-o,--output", o->output,
                  "Write the table here, for VSPLAT_TUNING; what was tried is reused from it (default: into the cache)")
      ->type_name("TABLE.json");
  add_common(*sub, o->common, {.profile = false, .overwrite = false, .outside = false});
  sub->footer(
      "Each set of parameters is checked against sums in double precision before it may win, and timed against the\n"
      "best so far; wrong sets are refused by name. Each result is stored at once: a search that was stopped\n"
      "continues where it stopped. VSPLAT_TUNING=off runs without a table, VSPLAT_TUNING=TABLE.json with that table.\n"
      "Examples:\n"
      "  vsplat tune\n"
      "  vsplat tune --full --for reconstruct,render,train\n"
      "  vsplat tune --model paper.safetensors --json");
  sub->callback([o, &run] { run = [o] { tune(*o); }; });
}

}  // namespace command
