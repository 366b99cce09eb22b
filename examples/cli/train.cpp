// vsplat train: a model from data sets.
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vsplat/vsplat.hpp>

#include "session.h"

namespace command {
namespace {

struct Options {
  Common common;
  std::string config, output;
  std::vector<std::string> data;
  bool resume = false, print_config = false, skip_bad = false;
};

std::string read_config(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(path + ": cannot be read");
  return text.str();
}

// Errors of the configuration begin with its path.
std::string whole_config(const std::string& path) {
  char* text = nullptr;
  const std::string given = path.empty() ? "" : read_config(path);
  if (vsplat_train_config(path.empty() ? nullptr : given.c_str(), &text) != VSPLAT_OK)
    throw std::runtime_error(path + ": " + vsplat_last_error());
  return vsplat::text(text);
}

void tell(void* user, const vsplat_train_progress* p) {
  const auto* common = static_cast<const Common*>(user);
  char line[256];
  std::snprintf(line, sizeof line,
                "step %lld of %lld: loss %.4f, PSNR %.2f dB (coarse %.2f), %.1f %% selected, %.2f objects/s, %s left",
                static_cast<long long>(p->step), static_cast<long long>(p->steps), p->loss, p->psnr, p->psnr_coarse,
                100 * p->selected, p->objects_per_second, seconds_text(p->seconds_left).c_str());
  say(*common, line);
}

void train(const Options& o) {
  start_log(o.common);
  const std::string config = whole_config(o.config);
  if (o.print_config) {
    std::printf("%s\n", config.c_str());
    return;
  }
  if (o.config.empty()) throw UsageError("train needs CONFIG, a JSON file; --print-config shows what it may hold");
  if (o.data.empty()) throw UsageError("train needs --data, folders with objects");
  if (o.output.empty()) throw UsageError("train needs --output, the run's folder");
  Session session(o.common);
  std::vector<const char*> data;
  for (const std::string& path : o.data) data.push_back(path.c_str());
  vsplat_train_options options = VSPLAT_TRAIN_OPTIONS_INIT;
  options.data = data.data();
  options.num_data = data.size();
  options.output = o.output.c_str();
  options.resume = o.resume;
  options.skip_bad = o.skip_bad;
  options.on_progress = tell;
  options.on_message = [](void* user, const char* text) { say(*static_cast<const Common*>(user), text); };
  options.go_on = [](void*) -> int32_t { return interrupted() ? 0 : 1; };
  options.user = const_cast<Common*>(&o.common);
  vsplat_train_result result = VSPLAT_TRAIN_RESULT_INIT;
  vsplat::check(vsplat_train(session.device().get(), config.c_str(), &options, &result));
  if (result.bad > 0) say(o.common, std::to_string(result.bad) + " bad views or objects were passed over");
  const std::string model = o.output + "/model.safetensors";
  if (result.stopped) say(o.common, "stopped after step " + std::to_string(result.step) + "; --resume goes on");
  if (o.common.json)
    std::printf("%s\n",
                nlohmann::ordered_json{
                    {"step", result.step}, {"stopped", result.stopped != 0}, {"bad", result.bad}, {"model", model}}
                    .dump(1)
                    .c_str());
  Outputs outputs(o.common.overwrite);
  session.write_profile(outputs);
}

}  // namespace

void add_train(CLI::App& app, Run& run) {
  auto o = std::make_shared<Options>();
  CLI::App* sub = app.add_subcommand("train", "Train a model on data sets of posed pictures");
  sub->add_option("config", o->config, "What to train and how, a JSON file; absent fields take their defaults")
      ->type_name("CONFIG.json");
  sub->add_option("--data", o->data, "Folders with objects, or an object's folder")->type_name("DIR...");
  sub->add_option("-o,--output", o->output, "The run's folder: log.csv, sheets, checkpoints, model.safetensors")
      ->type_name("RUN");
  sub->add_flag("--resume", o->resume, "Go on from the newest good checkpoint in RUN");
  sub->add_flag("--print-config", o->print_config, "Print the configuration with every field, and stop");
  sub->add_flag("--skip-bad", o->skip_bad, "Pass over and count data that cannot be read");
  add_common(*sub, o->common);
  sub->footer(
      "An interrupt (Ctrl-C) writes a checkpoint and stops; what is resumed ends with the same bits.\n"
      "Example:\n"
      "  vsplat dataset procedural --count 64 --size 128 --output solids\n"
      "  vsplat train small.json --data solids --output run");
  sub->callback([o, &run] { run = [o] { train(*o); }; });
}

}  // namespace command
