// vsplat train: trains a model on data sets.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "naming.h"
#include "session.h"

namespace command {
namespace {

namespace fs = std::filesystem;

struct TrainOptions {
  Common common;
  std::string config, output, init, textures;
  std::vector<std::string> data, compare;
  std::string selection, assume_selected, assume_intersections;
  std::vector<std::int64_t> extend;
  double pose_noise = -1;  // below 0: the configuration's
  bool resume = false, print_config = false, skip_bad = false, dry_run = false;
};

constexpr std::uintmax_t kLargestConfig = std::uintmax_t{64} << 20;

std::string read_config(const std::string& path) {
  std::error_code error;
  if (fs::exists(path, error) && !fs::is_regular_file(path, error))
    throw std::runtime_error(path + ": is no regular file; a configuration is expected");
  if (const auto size = fs::file_size(path, error); !error && size > kLargestConfig)
    throw std::runtime_error(path + ": has " + std::to_string(size) +
                             " bytes; a configuration of at most 64 MiB is expected");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(path + ": cannot be read");
  if (text.str().find_first_not_of(" \t\r\n") == std::string::npos)
    throw std::runtime_error(path + ": is empty; a JSON object is expected, {} where every field is to be its default");
  return text.str();
}

// The configuration with the field of --pose-noise; if the text is not an object, the library refuses it.
std::string with_pose_noise(const std::string& text, double sigma) {
  nlohmann::json config = nlohmann::json::parse(text, nullptr, false);
  if (sigma < 0 || !config.is_object()) return text;
  config["pose_noise"] = sigma;
  if (config.contains("stages") && config["stages"].is_array())
    for (nlohmann::json& stage : config["stages"])
      if (stage.is_object()) stage["pose_noise"] = sigma;
  return config.dump();
}

// Errors in the configuration begin with its path.
std::string whole_config(const std::string& path, double pose_noise) {
  if (path.empty()) return vsplat::train_config(with_pose_noise("{}", pose_noise));
  try {
    return vsplat::train_config(with_pose_noise(read_config(path), pose_noise));
  } catch (const vsplat::Error& e) {
    throw vsplat::Error(e.status(), (path + ": " + e.what()).c_str());
  }
}

void tell(void* user, const vsplat_train_progress* p) {
  const auto* common = static_cast<const Common*>(user);
  char line[256];
  const std::string left = p->seconds_left > 0 ? ", " + seconds_text(p->seconds_left) + " left" : "";
  std::snprintf(line, sizeof line,
                "step %lld of %lld: loss %.4f, PSNR %.2f dB (coarse %.2f), %.1f %% selected, %.2f objects/s%s",
                static_cast<long long>(p->step), static_cast<long long>(p->steps), p->loss, p->psnr, p->psnr_coarse,
                100 * p->selected, p->objects_per_second, left.c_str());
  say(*common, line);
}

uint64_t intersections(const TrainOptions& o) {
  if (o.assume_intersections.empty()) return 0;
  const double out = positive_number("--assume-intersections", o.assume_intersections, "number of intersections");
  if (out != std::floor(out) || out > 1e15)
    throw UsageError("--assume-intersections is \"" + o.assume_intersections + "\": a whole number expected");
  return static_cast<uint64_t>(out);
}

// Plans the assumed case, and the upper bound of any step.
void dry_run(const TrainOptions& o, const std::string& config) {
  Session session(o.common);
  vsplat_train_plan_options options = VSPLAT_TRAIN_PLAN_OPTIONS_INIT;
  options.selected = voxel_share("--assume-selected", o.assume_selected);
  options.selection = o.selection.empty() ? nullptr : o.selection.c_str();
  options.intersections = intersections(o);
  char title[256];
  std::string selected = "the voxels of " + o.selection;
  if (o.selection.empty()) {
    std::snprintf(title, sizeof title, "%.4g %%",
                  100 * (options.selected > 0 ? options.selected : VSPLAT_TRAIN_ASSUME_SELECTED));
    selected = title;
  }
  std::snprintf(title, sizeof title, " selected, %s intersections a picture",
                options.intersections > 0 ? std::to_string(options.intersections).c_str() : "8 per Gaussian");
  std::vector<Plan> plans{{"a step with " + selected + title, vsplat::train_plan(session.device(), config, options)}};
  options.bound = 1;
  plans.push_back({"everything selected and every Gaussian in every tile: no step takes more",
                   vsplat::train_plan(session.device(), config, options)});
  print_plans(o.common, plans);
}

bool is_numbered(const fs::path& path, const std::string& first, const std::string& last) {
  const std::string name = path.filename().string();
  return name.starts_with(first) && name.ends_with(last);
}

std::vector<std::string> numbered_files(const fs::path& folder, const std::string& first, const std::string& last) {
  std::vector<std::string> out;
  std::error_code error;
  for (auto at = fs::directory_iterator(folder, error); !error && at != fs::directory_iterator(); at.increment(error))
    if (is_numbered(at->path(), first, last)) out.push_back(at->path().string());
  return out;
}

// Expects the files that every run writes, and the sheets that exist. The library handles checkpoints: it refuses to
// start a training where there are any.
void expect_run(const TrainOptions& o, const std::string& config, Outputs& outputs) {
  const nlohmann::json fields = nlohmann::json::parse(config);
  const std::size_t stages = fields.contains("stages") ? fields["stages"].size() : 1;
  std::vector<fs::path> folders{o.output};
  for (std::size_t i = 1; stages > 1 && i <= stages; ++i)
    folders.push_back(folders.front() / ("stage-" + std::to_string(i)));
  std::vector<std::string> files, checkpoints;
  for (const fs::path& folder : folders) {
    for (const char* name : {"config.json", "log.csv", "model.safetensors", "record.json"})
      files.push_back((folder / name).string());
    for (std::string& sheet : numbered_files(folder / "sheets", "step-", ".png")) files.push_back(std::move(sheet));
    for (std::string& file : numbered_files(folder, "checkpoint-", ".safetensors"))
      checkpoints.push_back(std::move(file));
  }
  files.push_back((folders.front() / "report.html").string());
  if (!checkpoints.empty() && !o.resume)
    throw UsageError(o.output + ": holds a training's checkpoints already (" + checkpoints.front() +
                     "): --resume continues from them; or name another folder");
  // A run that was killed before its first checkpoint has left only its configuration.
  const std::string configuration = files.front();
  std::error_code error;
  const bool own = o.resume && (!checkpoints.empty() ||
                                (fs::is_regular_file(configuration, error) && read_config(configuration) == config));
  for (const std::string& file : files) {
    // A run may be resumed with its own config.json as the input: it is rewritten unchanged.
    if (own && file == configuration && fs::equivalent(o.config, configuration, error)) continue;
    own ? outputs.expect_renewed(file) : outputs.expect(file);
  }
}

// UsageError if a comparison of runs, which trains nothing, has options of a training.
void refuse_training(const TrainOptions& o) {
  const auto refuse = [](const char* what, bool given) {
    if (given) throw UsageError(std::string("--compare trains nothing: ") + what + " has no effect with it");
  };
  refuse("CONFIG", !o.config.empty());
  refuse("--data", !o.data.empty());
  refuse("--textures", !o.textures.empty());
  refuse("--init", !o.init.empty());
  refuse("--resume", o.resume);
  refuse("--extend", !o.extend.empty());
  refuse("--pose-noise", o.pose_noise >= 0);
  refuse("--print-config", o.print_config);
  refuse("--skip-bad", o.skip_bad);
  refuse("--dry-run", o.dry_run);
  refuse("--selection", !o.selection.empty());
  refuse("--assume-selected", !o.assume_selected.empty());
  refuse("--assume-intersections", !o.assume_intersections.empty());
  refuse("--profile", !o.common.profile.empty());
  refuse("--trace", !o.common.trace.empty());
}

// One run page about existing runs.
void compare(const TrainOptions& o) {
  refuse_training(o);
  if (o.output.empty()) throw UsageError("--compare needs --output, the page that it writes");
  need_ending("--output", o.output, ".html", "the page of --compare is HTML");
  Outputs outputs(o.common.overwrite);
  outputs.expect(o.output);
  for (const fs::path run : o.compare) {
    std::vector<std::string> folders = numbered_files(run, "stage-", "");
    folders.push_back(run.string());
    for (const fs::path folder : folders) {
      for (const char* name : {"config.json", "log.csv", "record.json"}) outputs.input((folder / name).string());
      for (const std::string& sheet : numbered_files(folder / "sheets", "step-", ".png")) outputs.input(sheet);
    }
  }
  vsplat::train_report(o.compare, outputs.begin(o.output));
  say(o.common, "report " + o.output);
  if (o.common.json) print_json(nlohmann::ordered_json{{"output", o.output}, {"runs", o.compare}});
  outputs.commit();
}

void train(TrainOptions& o) {
  set_up_library(o.common);
  if (!o.compare.empty()) return compare(o);
  const std::string config = whole_config(o.config, o.pose_noise);
  if (o.print_config) {
    std::printf("%s\n", config.c_str());
    return;
  }
  if (o.config.empty()) throw UsageError("train needs CONFIG, a JSON file; --print-config shows what it may hold");
  if (o.dry_run) {
    refuse_profile_of_dry_run(o.common);
    return dry_run(o, config);
  }
  if (o.output.empty()) throw UsageError("train needs --output, the run's folder");
  const Ranks ranks = join_ranks(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : {o.config, o.selection, o.init}) outputs.input(path);
  if (ranks.leads()) {
    for (const std::string& path : {o.common.profile, o.common.trace}) outputs.expect(path);
    expect_run(o, config, outputs);
    outputs.input_data(o.data);
  }
  Session session(o.common, Devices::several);
  session.about("command", "train");
  session.about("configuration", o.config);
  std::vector<const char*> data;
  for (const std::string& path : o.data) data.push_back(path.c_str());
  vsplat_train_options options = VSPLAT_TRAIN_OPTIONS_INIT;
  options.data = data.data();
  options.num_data = data.size();
  options.output = o.output.c_str();
  options.init = o.init.empty() ? nullptr : o.init.c_str();
  options.resume = o.resume;
  options.extend = o.extend.data();
  options.num_extend = o.extend.size();
  options.skip_bad = o.skip_bad;
  options.textures = o.textures.empty() ? nullptr : o.textures.c_str();
  options.on_progress = tell;
  options.on_message = [](void* user, const char* text) { say(*static_cast<const Common*>(user), text); };
  options.go_on = [](void*) -> int32_t { return interrupted() ? 0 : 1; };
  options.user = const_cast<Common*>(&o.common);
  options.selection = o.selection.empty() ? nullptr : o.selection.c_str();
  options.assume_selected = voxel_share("--assume-selected", o.assume_selected);
  options.assume_intersections = intersections(o);
  session.share(options);
  options.ranks = ranks.several();
  const vsplat_train_result result = naming(o.data, {o.output, o.init, o.textures, o.selection},
                                            [&] { return vsplat::train(session.device(), config, options); });
  if (!ranks.leads()) return;
  if (result.bad > 0) say(o.common, std::to_string(result.bad) + " bad views or objects were skipped");
  say(o.common, "at most " + bytes_text(result.peak) + " of device memory");
  const std::string model = o.output + "/model.safetensors";
  if (result.stopped) tell_stop(o.common, "stopped after step " + std::to_string(result.step) + "; --resume continues");
  if (o.common.json) {
    nlohmann::ordered_json out = {{"step", result.step},
                                  {"stopped", result.stopped != 0},
                                  {"bad", result.bad},
                                  {"peak_bytes", result.peak},
                                  {"model", model}};
    session.add_numerics(out);
    print_json(out);
  }
  session.write_profile(outputs);
  outputs.commit();
}

}  // namespace

void add_train(CLI::App& app, Run& run) {
  auto o = std::make_shared<TrainOptions>();
  CLI::App* sub = app.add_subcommand("train", "Train a model on data sets of posed pictures");
  sub->add_option("config", o->config, "What to train and how, a JSON file; missing fields have their defaults")
      ->type_name("CONFIG.json");
  sub->add_option("--data", o->data,
                  "Folders of objects, or an object's folder; not needed if the configuration's procedural is 1")
      ->type_name("DIR...");
  sub->add_option("--textures", o->textures,
                  "A folder of pictures that procedural objects and rooms' walls are covered with (the configuration's "
                  "procedural "
                  "and rooms)")
      ->type_name("DIR");
  sub->add_option(
         "-o,--output", o->output,
         "The run's folder: log.csv, report.html, sheets, checkpoints, model.safetensors; the page of --compare")
      ->type_name("RUN");
  sub->add_option("--init", o->init, "Begin with this model's weights instead of random ones (fine-tuning)")
      ->type_name("MODEL.safetensors");
  sub->add_option("--pose-noise", o->pose_noise,
                  "Standard deviation of the noise on input views' poses, drawn for each object, instead of the "
                  "configuration's pose_noise")
      ->check(CLI::Range(0.0, 1.0))
      ->type_name("SIGMA");
  sub->add_flag("--resume", o->resume, "Continue from the newest good checkpoint in RUN");
  sub->add_option("--extend", o->extend,
                  "With --resume: N more steps after the configuration's, with a warm-up and a cosine decay of the "
                  "learning rate of their own; --extend N,M adds M more after those")
      ->delimiter(',')
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1000000000}))
      ->type_name("N[,M...]");
  sub->add_option("--compare", o->compare,
                  "Train nothing: write one page with the curves of these runs, --output FILE.html")
      ->type_name("RUN...");
  sub->add_flag("--print-config", o->print_config, "Print the configuration with every field, and stop");
  sub->add_flag("--skip-bad", o->skip_bad, "Leave out data that cannot be read, and count them");
  const OptionGroup in(*sub, "Memory");
  sub->add_flag("--dry-run", o->dry_run, "Only print how much device memory a step takes; needs no data");
  sub->add_option("--assume-selected", o->assume_selected,
                  "Share of the voxels that memory is planned for at first (default: " +
                      share_text(VSPLAT_TRAIN_ASSUME_SELECTED) + ")")
      ->type_name("F");
  sub->add_option("--assume-intersections", o->assume_intersections,
                  "Intersections of Gaussians with tiles in a picture, as in log.csv (default: 8 for each Gaussian)")
      ->type_name("N");
  sub->add_option("--selection", o->selection, "Use these voxels in every step, whatever the network chooses")
      ->type_name("FILE");
  add_common(*sub, o->common, {.precision = true});
  sub->footer(
      "Sizes, the configuration's \"model\": tiny (pictures of 48 x 48 pixels; shows within minutes whether\n"
      "everything works), small (128 x 128; two CPU cores train it in days, at half a minute a step), paper\n"
      "(512 x 512; for a GPU: --dry-run shows how much memory a step takes). --print-config shows every field.\n"
      "Ctrl-C writes a checkpoint and stops; a resumed training ends with the same bits as one that was not stopped.\n"
      "Examples:\n"
      "  vsplat dataset procedural --count 64 --size 128 --output objects\n"
      "  echo '{\"model\": \"small\", \"steps\": 20000}' > small.json\n"
      "  vsplat train small.json --dry-run\n"
      "  vsplat train small.json --data objects --output run\n"
      "  vsplat train small.json --data objects --output run --resume\n"
      "  vsplat train small.json --data objects --output run --resume --extend 5000\n"
      "  vsplat train --compare run other --output both.html");
  sub->callback([o, &run] { run = [o] { train(*o); }; });
}

}  // namespace command
