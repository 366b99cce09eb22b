// vsplat fit: fits a scene to the user's own pictures, and measures it on held-out views.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "arguments.h"
#include "fit_settings.h"
#include "runtime/printable.h"
#include "scene_file.h"
#include "scene_page.h"

namespace command {
namespace {

namespace fs = std::filesystem;

struct FitCommand {
  Common common;
  FitSettings settings;
  std::vector<CLI::Option*> options;  // of the settings
  std::string views, output, settings_file, viewer;
  bool dry_run = false;
};

// SCENE.fit.json for SCENE.ply.
std::string beside(const std::string& output, const char* ending) {
  return fs::path(output).replace_extension(ending).string();
}

// Says how much memory the network before the fit and the fit at its largest size take, and how long the fit lasts.
void dry_run(const FitCommand& o, FitJob& job, FitInputs& inputs, const vsplat::Views& views) {
  refuse_profile_of_dry_run(o.common);
  Session session(o.common);
  inputs.load();
  std::vector<Plan> plans;
  if (job.options.start == VSPLAT_FIT_NETWORK) {
    vsplat_model_info model = VSPLAT_MODEL_INFO_INIT;
    vsplat::check(vsplat_model_get_info(job.options.model, &model));
    const int32_t wanted = o.settings.view_count ? o.settings.view_count : model.use_views;
    vsplat_plan plan = VSPLAT_PLAN_INIT;
    vsplat::check(vsplat_plan_reconstruct(session.device().get(), job.options.model,
                                          std::min(wanted, static_cast<int32_t>(views.size())), VSPLAT_ASSUME_SELECTED,
                                          &plan));
    plans.push_back({"the network before it", plan});
  }
  if (plans.empty() || plans.front().plan.fits) plans.push_back(job.plan(session, views));
  print_plans(o.common, plans);
}

void check(const FitCommand& o) {
  check(o.settings);
  if (o.output.empty() && !o.dry_run) throw UsageError("fit needs --output, the scene's file");
  need_scene_ending("--output", o.output, true);
}

// The files beside the scene: what was not asked for otherwise.
void name_files(FitCommand& o) {
  FitOptions& fit = o.settings.fit;
  if (fit.page == "none")
    fit.page.clear();
  else if (fit.page.empty() && !o.output.empty())
    fit.page = beside(o.output, ".fit.html");
  if (!o.output.empty()) fit.record = beside(o.output, ".fit.json");
}

void fit(FitCommand& o) {
  const AppliedSettings applied =
      o.settings_file.empty() ? AppliedSettings() : apply_settings_file(o.options, o.settings_file);
  const FitSettings& s = o.settings;
  std::optional<FitJob> made;
  std::optional<FitInputs> inputs;
  applied.naming([&] {
    check(o);
    name_files(o);
    made.emplace(s.fit);
    inputs.emplace(s, *made);
  });
  FitJob& job = *made;
  job.from = o.views;
  job.given_settings = settings_in(o.options);
  set_up_library(o.common);
  const vsplat::Views views =
      vsplat::Views::load(o.views, views_options(s.picture_folder, s.skip_bad, inputs->named()));
  if (o.dry_run) return dry_run(o, job, *inputs, views);

  Outputs outputs(o.common.overwrite);
  for (const std::string& path : {start_file(s), s.model, o.settings_file}) outputs.input(path);
  for (const std::string& path : views.files()) outputs.input(path);
  SceneFile file(outputs, o.output);
  PageFile page(outputs, o.output, o.viewer, {o.views, s.picture_folder});
  for (const std::string& path : {o.common.profile, o.common.trace}) outputs.expect(path);
  job.expect(outputs, o.output);

  Session session(o.common);
  session.about("command", "fit");
  if (uses_network(s)) session.about("model", model_name(s.model));
  session.about("scene", o.views);
  inputs->load();
  const vsplat::Scene result = job.run(session, o.common, views, outputs, {}, [&](const vsplat::Scene& scene) {
    file.save(o.common, scene);
    outputs.keep();
  });
  page.save(o.common, job.scenes("start", result));
  session.write_profile(outputs);
  outputs.commit();
  job.summarise(o.common);
  say(o.common,
      o.output + ": " + std::to_string(result.info().count) + " Gaussians, " + seconds_text(elapsed_seconds()));
  if (!is_page(o.output) && o.views != "-")
    say(o.common, "next: vsplat view " + vsplat::shell_word(o.output) + " --cameras " + vsplat::shell_word(o.views) +
                      (s.picture_folder.empty() ? "" : " --pictures " + vsplat::shell_word(s.picture_folder)));
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"output", o.output}, {"gaussians", result.info().count}};
  file.add_results(out);
  page.add_results(out);
  job.add_results(out);
  session.add_numerics(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

}  // namespace

void add_fit(CLI::App& app, Run& run) {
  auto o = std::make_shared<FitCommand>();
  CLI::App* sub = app.add_subcommand("fit", "Fit a scene to its pictures, and measure the gain on held-out views");
  sub->add_option("VIEWS", o->views,
                  "Posed pictures: transforms.json, cameras.json, a COLMAP model, or a folder with one of these")
      ->required()
      ->type_name("VIEWS");
  sub->add_option("-o,--output", o->output, "The scene to write, in the format of its ending, or its page (.html)")
      ->type_name("SCENE");
  FitOptions& fit_options = o->settings.fit;
  o->options = add_fit_settings(*sub, o->settings);
  sub->add_option("--settings", o->settings_file,
                  "Settings for what is not given here: the SCENE.fit.json of an earlier fit, or an object of options "
                  "by their names, {\"steps\": 3000}; paths in it are relative to the current folder")
      ->type_name("FILE.json");
  const char* files = "Beside the scene";
  add_viewer_option(*sub, o->viewer, files);
  sub->add_option("--page", fit_options.page,
                  "A page with curves, held-out pictures, times and settings (default: SCENE.fit.html)")
      ->type_name("FILE.html|none")
      ->group(files);
  sub->add_option("--sheet", fit_options.sheet,
                  "A row for each held-out picture: picture, start, result, 4 x difference; for fitted pictures if "
                  "none is held out")
      ->type_name("FILE.png")
      ->group(files);
  sub->add_option("--log", fit_options.log,
                  "A row for each step: phase, loss, Gaussians, PSNR held out, seconds; the last row also has psnr_cc")
      ->type_name("FILE.csv")
      ->group(files);
  sub->add_option("--checkpoint", fit_options.checkpoint, "Folder in which the state is saved from time to time")
      ->type_name("DIR")
      ->group(files);
  sub->add_flag("--resume", fit_options.resume,
                "Continue from the state in --checkpoint; the result has the same bytes as without the interruption")
      ->group(files);
  sub->add_option("--live", fit_options.live,
                  "Serve a page on 127.0.0.1 that shows the scene, curves and held-out pictures while it fits (default "
                  "port: the first free one from " +
                      std::to_string(first_live_port) + ")")
      ->expected(0, 1)
      ->default_str("auto")
      ->type_name("PORT")
      ->group(files);
  sub->add_flag("--dry-run", o->dry_run, "Only print how much memory and time it would take; a few steps are timed")
      ->group(files);
  add_common(*sub, o->common);
  sub->footer(
      "Examples:\n"
      "  vsplat fit photos/ --start network --output sharp.ply --sheet sheet.png\n"
      "  vsplat fit photos/ --start scene.ply --output sharp.ply --size full --time 120 --viewer sharp.html\n"
      "  vsplat fit colmap/ --pictures photos/ --start points --auto-frame --output scene.ply --steps 3000\n"
      "  vsplat fit photos/ --start network --output sharp.ply --poses --exposure\n"
      "  vsplat fit photos/ --start network --output sharp.ply --steps 20000 --checkpoint state/ --resume\n"
      "  vsplat fit photos/ --start points --output place.ply --scale 20 --background sky --masks ignore\n"
      "  vsplat fit photos/ --start scene.ply --output recoloured.ply --freeze means,scales,rotations,opacities\n"
      "  vsplat fit photos/ --settings sharp.fit.json --seed 1 --output again.ply\n"
      "The result is never worse than the start on the held-out pictures: if the start is best, it is written, and a\n"
      "message says so. Masks and alpha are used if there are any. Ctrl-C stops with the best scene so far; a second\n"
      "one stops at once. The same input gives the same bytes, except with --time. The settings in effect are written\n"
      "to SCENE.fit.json.");
  sub->callback([o, &run] { run = [o] { fit(*o); }; });
}

}  // namespace command
