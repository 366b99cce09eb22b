// vsplat evaluate: how well a model reconstructs the objects of data sets, beside baselines without a network.
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vsplat/vsplat.hpp>

#include "command.h"
#include "evaluate_scenes.h"
#include "evaluate_table.h"
#include "naming.h"
#include "outputs.h"
#include "placement_options.h"
#include "session.h"

namespace command {
namespace {

using nlohmann::ordered_json;

struct EvaluateOptions {
  Common common;
  PlacementOptions placement;
  std::vector<std::string> folders;
  std::string model, protocol = "kmeans", seed, lpips, sheet, supersample;
  TableOptions table;
  ScenesOptions scenes;
  int size = 0, view_count = 0;
  double pose_noise = 0;
  int pose_draws = 0;
  bool skip_bad = false, refine = false;
};

// A score: its name in JSON, its heading, and its format.
struct Column {
  const char *name, *heading;
  double vsplat_scores::*value;
  int digits;
  double factor;
  bool always = true;  // false: shown only if present: LPIPS with weights, poses under noise, predicted rays
};
constexpr Column columns[] = {{"psnr", "PSNR", &vsplat_scores::psnr, 2, 1},
                              {"psnr_coarse", "coarse", &vsplat_scores::psnr_coarse, 2, 1},
                              {"ssim", "SSIM", &vsplat_scores::ssim, 4, 1},
                              {"psnr_white", "white", &vsplat_scores::psnr_white, 2, 1},
                              {"psnr_nearest", "nearest", &vsplat_scores::psnr_nearest, 2, 1},
                              {"selected", "voxels %", &vsplat_scores::selected, 2, 100},
                              {"lpips_alex", "LPIPS alex", &vsplat_scores::lpips_alex, 4, 1, false},
                              {"lpips_vgg", "LPIPS vgg", &vsplat_scores::lpips_vgg, 4, 1, false},
                              {"pose_degrees", "pose deg", &vsplat_scores::pose_degrees, 3, 1, false},
                              {"pose_distance", "pose dist", &vsplat_scores::pose_distance, 4, 1, false},
                              {"ray_degrees", "ray deg", &vsplat_scores::ray_degrees, 3, 1, false},
                              {"ray_moment", "ray moment", &vsplat_scores::ray_moment, 4, 1, false}};

std::vector<Column> columns_of(const vsplat_scores& mean) {
  std::vector<Column> out;
  for (const Column& column : columns)
    if (column.always || !std::isnan(mean.*column.value)) out.push_back(column);
  return out;
}

// What is printed: for a whole evaluation, or for the objects done before it ended early.
struct Results {
  std::vector<vsplat::Evaluation::Object> objects;
  vsplat_scores mean;
  std::string stopped;  // the reason; "" if complete
};

vsplat_scores mean_of(const std::vector<vsplat::Evaluation::Object>& objects) {
  vsplat_scores out = VSPLAT_SCORES_INIT;
  for (const Column& column : columns) {
    double sum = 0;
    for (const auto& object : objects) sum += object.scores.*column.value;
    out.*column.value = sum / static_cast<double>(objects.size());
  }
  return out;
}

ordered_json json_of(const std::vector<Column>& shown, const vsplat_scores& scores) {
  ordered_json out = ordered_json::object();
  for (const Column& column : shown) {
    const double value = scores.*column.value;
    out[column.name] = std::isfinite(value) ? ordered_json(value) : ordered_json();
  }
  return out;
}

void print_results(const Results& results, const Session& session) {
  const std::vector<Column> shown = columns_of(results.mean);
  ordered_json objects = ordered_json::array();
  for (const auto& object : results.objects) {
    ordered_json row = {{"name", object.name}};
    row.update(json_of(shown, object.scores));
    objects.push_back(std::move(row));
  }
  ordered_json out = {{"objects", objects}, {"mean", json_of(shown, results.mean)}};
  if (!results.stopped.empty()) out["stopped"] = results.stopped;
  session.add_numerics(out);
  print_json(out);
}

void print_row(const std::vector<Column>& shown, int width, const std::string& name, const vsplat_scores& scores) {
  std::printf("%-*s", width, for_terminal(name).c_str());
  for (const Column& column : shown) std::printf(" %10.*f", column.digits, column.factor * (scores.*column.value));
  std::printf("\n");
}

void print_table(const Results& results) {
  const std::vector<Column> shown = columns_of(results.mean);
  const std::vector<vsplat::Evaluation::Object>& objects = results.objects;
  std::size_t width = 6;
  for (const auto& object : objects) width = std::max(width, object.name.size());
  std::printf("%-*s", static_cast<int>(width), "object");
  for (const Column& column : shown) std::printf(" %10s", column.heading);
  std::printf("\n");
  for (const auto& object : objects) print_row(shown, static_cast<int>(width), object.name, object.scores);
  print_row(shown, static_cast<int>(width), "mean", results.mean);
}

void print(const EvaluateOptions& o, const Session& session, const Results& results) {
  clear_progress();
  o.common.json ? print_results(results, session) : print_table(results);
}

// Collects finished objects. If an error or an interrupt ends the evaluation, prints them before the error is reported.
class Recorded {
 public:
  Recorded(const EvaluateOptions& options, const Session& session) : options_(options), session_(session) {}

  void add(const char* name, const vsplat_scores& scores) { objects_.push_back({name, scores}); }

  [[noreturn]] void end(const vsplat::Error& error, std::size_t all) const {
    const bool cancelled = error.status() == VSPLAT_ERROR_CANCELLED;
    const std::string why = cancelled ? "interrupted" : error.what();
    if (!objects_.empty()) print(options_, session_, {objects_, mean_of(objects_), why});
    if (cancelled)
      throw std::runtime_error("interrupted after " + std::to_string(objects_.size()) + " of " + std::to_string(all) +
                               " objects");
    throw error;
  }

 private:
  const EvaluateOptions& options_;
  const Session& session_;
  std::vector<vsplat::Evaluation::Object> objects_;
};

// Argument of both callbacks.
struct Listener {
  Session& session;
  Recorded recorded;
};

void evaluate(EvaluateOptions& o) {
  if (o.folders.empty()) throw UsageError("DIR... is required, or --table, or --scenes");
  if (!o.table.outputs.empty()) throw UsageError("--output is for --table and --scenes");
  if (o.table.dry_run) throw UsageError("--dry-run is for --table and --scenes");
  vsplat_evaluate_options options = VSPLAT_EVALUATE_OPTIONS_INIT;
  options.protocol = o.protocol == "random10" ? VSPLAT_PROTOCOL_RANDOM10 : VSPLAT_PROTOCOL_KMEANS;
  if (!o.seed.empty()) options.seed = seed_value("--seed", o.seed);
  if (!o.seed.empty() && o.protocol != "random10" && o.pose_noise == 0)
    throw UsageError("--seed needs --protocol random10 or --pose-noise");
  if (o.pose_draws != 0 && o.pose_noise == 0) throw UsageError("--pose-draws needs --pose-noise");
  options.pose_noise = o.pose_noise;
  options.pose_draws = o.pose_draws;
  set_placement(o.placement, options);
  options.lpips = o.lpips.empty() ? nullptr : o.lpips.c_str();
  options.picture_size = o.size;
  options.supersample = samples("--supersample", o.supersample);
  options.view_count = o.view_count;
  options.skip_bad = o.skip_bad;
  options.sheet = !o.sheet.empty();
  options.refine = o.refine;
  set_up_library(o.common);
  const Ranks ranks = join_ranks(o.common);
  options.ranks = ranks.several();
  Outputs outputs(o.common.overwrite);
  outputs.input(o.model);
  for (const char* net : {"/alex.safetensors", "/vgg.safetensors"})
    if (!o.lpips.empty()) outputs.input(o.lpips + net);
  if (ranks.leads())
    for (const std::string& path : {o.sheet, o.common.profile, o.common.trace}) outputs.expect(path);
  outputs.input_data(o.folders);

  Session session(o.common, Devices::several);
  session.share(options);
  session.about("command", "evaluate");
  session.about("model", model_name(o.model));
  session.about("scene", o.folders.front());
  const vsplat::Model model = load_model(o.model);
  const vsplat::DataSet data(o.folders);
  Listener listener{session, Recorded(o, session)};
  options.progress = [](void* user, const char* stage, double done) {
    return Session::on_progress(&static_cast<Listener*>(user)->session, stage, done);
  };
  options.on_object = [](void* user, const char* name, const vsplat_scores* scores) {
    static_cast<Listener*>(user)->recorded.add(name, *scores);
  };
  options.user = &listener;
  session.start("evaluating");
  const vsplat::Evaluation evaluation = [&] {
    try {
      return naming(o.folders, {o.model, o.lpips},
                    [&] { return vsplat::Evaluation(session.device(), model, data, options); });
    } catch (const vsplat::Error& e) {
      listener.recorded.end(e, data.count());
    }
  }();
  if (!ranks.leads()) return;
  if (!o.sheet.empty()) evaluation.save_sheet(outputs.begin(o.sheet));
  session.write_profile(outputs);
  outputs.commit();
  print(o, session, {evaluation.objects(), evaluation.mean(), ""});
  const std::size_t count = evaluation.objects().size();
  say(o.common, std::to_string(count) + (count == 1 ? " object" : " objects") +
                    (evaluation.skipped() ? ", " + std::to_string(evaluation.skipped()) + " left out" : "") +
                    (o.sheet.empty() ? "" : ", " + o.sheet) + ", " + seconds_text(elapsed_seconds()));
}

}  // namespace

void add_evaluate(CLI::App& app, Run& run) {
  auto o = std::make_shared<EvaluateOptions>();
  CLI::App* sub = app.add_subcommand("evaluate", "Measure a model on the objects of data sets");
  sub->add_option("folders", o->folders,
                  "An object's folder (as for reconstruct), an HDF5 file in LaRa's layout, or a folder of these")
      ->type_name("DIR...");
  sub->add_option("-m,--model", o->model, "The model file (default: the built-in model)")->type_name("MODEL");
  sub->add_option("--protocol", o->protocol,
                  "Which views are compared: the last of each of four k-means groups of the cameras (default), or ten "
                  "at random; the inputs are the first of each group")
      ->check(one_of({"kmeans", "random10"}))
      ->type_name("kmeans|random10");
  sub->add_option("--seed", o->seed, "Seed of --protocol random10 and --pose-noise (default: 0)")->type_name("S");
  sub->add_option("--view-count", o->view_count,
                  "Number of input views (default: as many as the model was trained with)")
      ->check(CLI::Range(1, 16))
      ->type_name("N");
  sub->add_option("--size", o->size,
                  "Compare pictures of N x N pixels: the truth is resampled by area, the result drawn at N; the inputs "
                  "keep the model's size (default: compare at that size, too)")
      ->check(CLI::Range(11, 4096))
      ->type_name("N");
  sub->add_option("--supersample", o->supersample,
                  "Samples along a pixel's edge of drawn pictures, 1 to 8 (default: auto, as in `vsplat render`: more "
                  "than one if pixels are at least twice as wide as the inputs' at the model's size)")
      ->type_name("N|auto");
  sub->add_option("--lpips", o->lpips, "Folder with alex.safetensors, vgg.safetensors or both: adds LPIPS")
      ->type_name("DIR");
  sub->add_option("--sheet", o->sheet, "Best, median and worst object: inputs, truth, coarse level, result in rows")
      ->type_name("FILE.png");
  sub->add_flag("--refine", o->refine,
                "Measure the scene after fitting it to the inputs alone, as `vsplat fit --start network` does");
  sub->add_option("--pose-noise", o->pose_noise,
                  "Give the network noisy poses of all inputs but the first: turned and moved about the object by "
                  "normal random numbers of this standard deviation, in radians and in edges of its cube")
      ->check(CLI::Range(0.0, 1.0))
      ->type_name("SIGMA");
  sub->add_option("--pose-draws", o->pose_draws,
                  "Number of draws of that noise; each result is the mean over them (default: 1)")
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  sub->add_flag("--skip-bad", o->skip_bad, "Leave out views and objects that cannot be read, and count them");
  add_placement_options(*sub, o->placement);
  // The table's file says what is measured, so no other option may be given.
  std::vector<CLI::Option*> others;
  for (CLI::Option* option : sub->get_options())
    if (option->get_name() != "--help" && option->get_name() != "--skip-bad") others.push_back(option);
  CLI::Option* table =
      sub->add_option("--table", o->table.file,
                      "Measure the systems, data sets and protocols that this file lists: a row for each")
          ->type_name("FILE.json");
  CLI::Option* scenes =
      sub->add_option("--scenes", o->scenes.file,
                      "Measure scenes on held-out photographs of the sets that this file lists; scenes that are not "
                      "ready are fitted")
          ->type_name("LIST.json");
  for (CLI::Option* other : others) {
    table->excludes(other);
    if (other->get_name() != "--lpips") scenes->excludes(other);
  }
  scenes->excludes(table)->excludes(sub->get_option("--skip-bad"));
  sub->add_option("-o,--output", o->table.outputs,
                  "Also write the table of --table or --scenes to this file; may be given several times")
      ->allow_extra_args(false)
      ->type_name("FILE.md|.csv|.json");
  sub->add_flag("--dry-run", o->table.dry_run,
                "Only read what --table or --scenes lists, and print the memory of each row, or the views");
  add_common(*sub, o->common, {.precision = true, .automatic_precision = true});
  sub->footer(
      "Columns: PSNR (dB) of the result, of its coarse level, of white pictures, and of the input view nearest to\n"
      "each novel one; SSIM; the share of voxels that were selected. Each is over all novel views of an object\n"
      "together, on white. With --pose-noise, the error of the poses that the network got, and of the rays if the\n"
      "model predicts them: degrees, and distances in edges of the cube.\n"
      "Examples:\n"
      "  vsplat evaluate set/ --sheet sheet.png\n"
      "  vsplat evaluate set/ --size 256 --refine\n"
      "  vsplat evaluate set/ --size 128 --json\n"
      "  vsplat evaluate --table tables.json --dry-run\n"
      "  vsplat evaluate --table tables.json --output tables.md --output tables.csv\n"
      "  vsplat evaluate --scenes list.json --lpips weights/ --output table.md\n"
      "  vsplat evaluate set/ --pose-noise 0.02 --pose-draws 3 --seed 1\n"
      "  vsplat evaluate photos/cup --model model.safetensors --protocol random10 --seed 1 --json");
  sub->callback([o, &run] {
    run = [o] {
      o->table.skip_bad = o->skip_bad;
      o->scenes.lpips = o->lpips, o->scenes.outputs = o->table.outputs, o->scenes.dry_run = o->table.dry_run;
      if (!o->scenes.file.empty()) return evaluate_scenes(o->common, o->scenes);
      o->table.file.empty() ? evaluate(*o) : evaluate_table(o->common, o->table);
    };
  });
}

}  // namespace command
