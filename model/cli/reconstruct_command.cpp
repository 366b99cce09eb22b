// vsplat reconstruct, the main command: posed pictures and a model in, a scene and pictures of it out.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "fit_job.h"
#include "naming.h"
#include "picture_files.h"
#include "placement_options.h"
#include "reconstruct_list.h"
#include "scene_file.h"
#include "scene_page.h"

namespace command {
namespace {

struct ReconstructOptions {
  Common common;
  PictureOptions pictures;
  PlacementOptions placement;
  std::string views, model, output, names, picture_folder, write_views, write_selection, dump;
  std::string selection, selection_seed, assume_selected, merge_cell, viewer;
  int view_count = 0, passes = 0;  // 0: the model's
  int fit_epochs = -1;             // below 0: the model's
  bool force = false, dry_run = false, refine = false;
  FitOptions fit;
  std::string list;
  bool skip_existing = false;
};

constexpr FitNames fit_names{"--refine-steps", "--refine-size", "--refine-sheet", "--refine-time"};

// Options, parsed and checked against each other before anything is opened.
struct Request {
  explicit Request(const ReconstructOptions& o);

  PictureJob pictures;
  std::vector<std::string> names;
  std::vector<const char*> name_pointers;
  vsplat_views_options views = VSPLAT_VIEWS_OPTIONS_INIT;
  vsplat_input_options input = VSPLAT_INPUT_OPTIONS_INIT;
  vsplat_reconstruct_options run = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  std::optional<FitJob> fit;
};

Request::Request(const ReconstructOptions& o) : pictures(o.pictures) {
  if (o.output.empty() && !o.dry_run)
    throw UsageError(o.list.empty() ? "reconstruct needs --output, the scene's file"
                                    : "reconstruct --list needs --output, the folder for the scenes");
  if (o.list.empty()) need_scene_ending("--output", o.output, true);
  if (pictures.wanted && !pictures.written)
    throw UsageError(
        "--render needs --images, the folder for the pictures, or --sheet, --turntable, --compare or --write-cameras");
  if (!pictures.wanted && pictures.written)
    throw UsageError(
        "--images, --sheet, --turntable, --compare and --write-cameras need --render, the cameras to draw from: a "
        "file, orbit:N or path:CAMERAS:N");
  if (!o.names.empty()) names = list("--views", o.names);
  for (const std::string& name : names) name_pointers.push_back(name.c_str());
  views = views_options(o.picture_folder, o.pictures.skip_bad, !names.empty());
  input.names = name_pointers.empty() ? nullptr : name_pointers.data();
  input.num_names = name_pointers.size();
  input.view_count = o.view_count;
  set_placement(o.placement, input);
  input.force = o.force;
  for (const auto& [name, value] : {std::pair{"--refine-steps", o.fit.steps},
                                    {"--time", o.fit.seconds},
                                    {"--refine-size", o.fit.size},
                                    {"--refine-sheet", o.fit.sheet}})
    if (!o.refine && !value.empty()) throw UsageError(std::string(name) + " needs --refine");
  if (o.refine && !o.selection.empty())
    throw UsageError("--selection belongs to one set of views, but --refine runs the network on others, too");
  if (o.refine) fit.emplace(o.fit, fit_names);
  run.selection = o.selection.empty() ? nullptr : o.selection.c_str();
  if (!o.selection_seed.empty()) {
    if (run.selection) throw UsageError("--selection-seed has no effect with --selection: give one of them");
    run.has_seed = 1;
    run.seed = seed_value("--selection-seed", o.selection_seed);
  }
  run.passes = o.passes;
  if (!o.merge_cell.empty())
    run.merge_cell =
        o.merge_cell == "none" ? -1 : positive_number("--merge-cell", o.merge_cell, "edge in voxels, or none");
  if (o.fit_epochs >= 0) run.fit_epochs = o.fit_epochs > 0 ? o.fit_epochs : -1;
  run.near_plane = pictures.near;
  if (pictures.orbit_options.has_up) std::copy_n(pictures.orbit_options.up, 3, run.up);
  run.dump = o.dump.empty() ? nullptr : o.dump.c_str();
  run.assume_selected = voxel_share("--assume-selected", o.assume_selected);
}

void dry_run(const ReconstructOptions& o, const Request& request) {
  Session session(o.common);
  const vsplat::Model model = load_model(o.model);
  const vsplat_model_info info = model.info();
  const vsplat::Views list = vsplat::Views::load(o.views, request.views);
  size_t listed = 0;
  uint64_t pictures = 0;
  vsplat::check(vsplat_views_count(list.get(), &listed));
  vsplat::check(vsplat_views_get_memory(list.get(), &pictures));
  const int32_t most = o.view_count ? o.view_count : info.use_views;
  const size_t views = request.names.empty() ? std::min(listed, static_cast<size_t>(most)) : request.names.size();
  const double share = request.run.assume_selected > 0 ? request.run.assume_selected : VSPLAT_ASSUME_SELECTED;
  std::vector<Plan> plans;
  for (const double selected : {share, 1.0}) {
    vsplat_plan plan = VSPLAT_PLAN_INIT;
    vsplat::check(
        vsplat_plan_reconstruct(session.device().get(), model.get(), static_cast<int32_t>(views), selected, &plan));
    add_host_memory(plan, pictures, session.device());
    char title[128];
    std::snprintf(title, sizeof title, "%zu views, %.4g %% selected%s", views, 100 * selected,
                  selected == 1.0 ? " (the network cannot take more)" : "");
    plans.push_back({title, plan});
    if (share == 1.0) break;
  }
  print_plans(o.common, plans);
}

// How the result is made: a dump is of one pass and the network alone, but the start of a fit is made beside it.
struct MadeIn {
  int32_t passes = 1, fit_epochs = 0;
};
MadeIn made_in(const vsplat_reconstruct_options& run, const vsplat_model_info& model, int32_t views, bool fits) {
  if (run.dump && !fits) return {};
  const int32_t epochs = std::max(run.fit_epochs ? run.fit_epochs : model.fit_epochs, 0);
  return {run.selection ? 1 : std::min(run.passes ? run.passes : model.passes, views), epochs};
}

void summarise(const ReconstructOptions& o, const Session& session, const PictureJob& job, const vsplat::Input& input,
               const vsplat::Scene& scene, const SceneFile& file, const PageFile& page, std::size_t pictures,
               const std::optional<Comparison>& comparison, const std::optional<FitJob>& fit, MadeIn made) {
  const vsplat_scene_info info = scene.info();
  const std::size_t selected = (fit ? fit->start() : scene).selection().size();
  if (comparison) say(o.common, comparison->table());
  if (fit) fit->summarise(o.common);
  const std::string from = made.passes > 1 ? std::to_string(made.passes) + " passes (" + std::to_string(selected) +
                                                 " voxels selected in the first)"
                                           : std::to_string(selected) + " selected voxels";
  say(o.common,
      o.output + ": " + std::to_string(info.count) + " Gaussians from " + from +
          (made.fit_epochs && !fit ? ", fitted to the pictures in " + std::to_string(made.fit_epochs) + " epochs"
                                   : "") +
          (pictures ? ", " + job.summary(pictures) : "") + ", " + seconds_text(elapsed_seconds()));
  if (!o.common.json) return;
  const vsplat_input_info placed = input.info();
  nlohmann::ordered_json out = {{"output", o.output},
                                {"gaussians", info.count},
                                {"passes", made.passes},
                                {"fit_epochs", made.fit_epochs},
                                {"selected", selected},
                                {"views", placed.views},
                                {"center", {placed.center[0], placed.center[1], placed.center[2]}},
                                {"scale", placed.scale},
                                {"near", info.near_plane},
                                {"up", {info.up[0], info.up[1], info.up[2]}},
                                {"images", job.images.empty() ? 0 : pictures}};
  file.add_results(out);
  page.add_results(out);
  job.add_results(comparison, out);
  if (fit) fit->add_results(out["refined"]);
  session.add_numerics(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

// Fits a scene to all used views (those of --views, else all that are listed), starting from the network's scene from
// the same views in the same cube. Writes the network's scene and its page first, so that they remain if the fit ends
// early.
vsplat::Scene fit_to_pictures(const ReconstructOptions& o, Request& request, Session& session,
                              const vsplat::Model& model, const vsplat::Views& views, const vsplat::Input& input,
                              SceneFile& file, PageFile& page, Outputs& outputs) {
  const vsplat_input_info placed = input.info();
  vsplat_input_options same = request.input;
  same.has_center = 1;
  std::copy(std::begin(placed.center), std::end(placed.center), same.center);
  same.scale = placed.scale;
  vsplat_fit_options& options = request.fit->options;
  request.fit->from = o.views;
  options.start = VSPLAT_FIT_NETWORK;
  options.model = model.get();
  options.input = &same;
  options.reconstruct = &request.run;
  options.names = request.input.names;
  options.num_names = request.input.num_names;
  const auto keep = [&](const vsplat::Scene& scene) {
    file.save(o.common, scene);
    outputs.keep();
  };
  const auto keep_start = [&](const vsplat::Scene& start) {
    keep(start);
    page.save(o.common, {{"network", start}});
    outputs.keep();
    say(o.common,
        o.output + ": " + std::to_string(start.info().count) + " Gaussians from the network; they are fitted now");
  };
  vsplat::Scene fitted = request.fit->run(session, o.common, views, outputs, keep_start, keep);
  page.save(o.common, request.fit->scenes("network", fitted));
  outputs.keep();
  return fitted;
}

// Draws a scene that is already written; if the user stops this, or it fails, the scene remains.
void draw_fitted(const ReconstructOptions& o, Session& session, const PictureJob& job, const vsplat::Scene& scene,
                 const std::vector<vsplat_camera>& cameras, std::optional<Comparison>& comparison, Outputs& outputs) {
  const std::string written = o.output + " is written, its pictures are not: vsplat render draws them";
  try {
    if (interrupted()) throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
    job.draw(session, scene, cameras, comparison, outputs);
  } catch (const vsplat::Error& e) {
    if (e.status() != VSPLAT_ERROR_CANCELLED) throw;
    throw std::runtime_error("stopped; " + written);
  }
}

// The file that the library writes for --dump.
std::string dump_file(const ReconstructOptions& o) {
  return (std::filesystem::path(o.dump) / "stages.safetensors").string();
}

void reconstruct(ReconstructOptions& o) {
  if (o.views.empty() && o.list.empty()) throw UsageError("VIEWS is required, or --list");
  if (o.skip_existing && o.list.empty()) throw UsageError("--skip-existing needs --list");
  Request request(o);
  set_up_library(o.common);
  if (!o.list.empty())
    return reconstruct_list(
        {o.common, o.list, o.model, request.views, o.output, o.skip_existing, request.input, request.run});
  if (o.dry_run) {
    refuse_profile_of_dry_run(o.common);
    return dry_run(o, request);
  }
  const PictureJob& job = request.pictures;
  Outputs outputs(o.common.overwrite);
  const vsplat::Views views = vsplat::Views::load(o.views, request.views);
  for (const std::string& path : {o.model, o.selection}) outputs.input(path);
  outputs.input_cameras(job.choice.file);
  for (const std::string& path : views.files()) outputs.input(path);
  SceneFile file(outputs, o.output);
  PageFile page(outputs, o.output, o.viewer, {o.views, o.picture_folder});
  for (const std::string& path : {o.write_selection, o.common.profile, o.common.trace}) outputs.expect(path);
  if (!o.dump.empty()) outputs.expect(dump_file(o));
  if (request.fit) request.fit->expect(outputs, o.output);
  if (job.choice.orbit) job.expect(outputs, static_cast<std::size_t>(job.choice.orbit));

  Session session(o.common);
  session.about("command", "reconstruct");
  session.about("model", model_name(o.model));
  session.about("scene", o.views);
  const vsplat::Model model = load_model(o.model);
  Shots shots;
  if (job.wanted && !job.choice.orbit) {
    shots = job.load_cameras();
    job.expect(outputs, shots.all.size());
  }
  const std::vector<std::string> others = {o.model, o.selection};
  const auto input = naming({o.views}, others, [&] { return vsplat::Input(model, views, request.input); });
  if (job.choice.orbit) {
    shots.listed = naming({o.views}, others, [&] { return input.orbit(job.orbit_options); });
    shots.all = shots.listed.all();
  }
  std::optional<Comparison> comparison;
  if (job.wanted) comparison = job.prepare(shots, outputs);
  const std::vector<std::string> view_files =
      o.write_views.empty() ? std::vector<std::string>() : input.files(o.write_views);
  for (const std::string& path : view_files) outputs.expect(path);

  request.run.progress = Session::on_progress;
  request.run.user = &session;
  if (request.run.dump) outputs.begin(dump_file(o));
  session.start("reconstructing");
  vsplat::Scene scene;
  if (!request.fit || request.run.dump)
    scene = naming({o.views}, others, [&] { return vsplat::reconstruct(session.device(), model, input, request.run); });
  if (request.fit) scene = fit_to_pictures(o, request, session, model, views, input, file, page, outputs);
  if (job.wanted && request.fit)
    draw_fitted(o, session, job, scene, shots.all, comparison, outputs);
  else if (job.wanted)
    job.draw(session, scene, shots.all, comparison, outputs);
  for (const std::string& path : view_files) outputs.begin(path);
  if (!o.write_views.empty()) input.save(o.write_views);
  if (!o.write_selection.empty())
    vsplat::check(vsplat_scene_save_selection((request.fit ? request.fit->start() : scene).get(),
                                              outputs.begin(o.write_selection).c_str()));
  if (!request.fit) {
    file.save(o.common, scene);
    page.save(o.common, {{"network", scene}});
  }
  session.write_profile(outputs);
  outputs.commit();
  summarise(o, session, job, input, scene, file, page, shots.all.size(), comparison, request.fit,
            made_in(request.run, model.info(), input.info().views, request.fit.has_value()));
}

void add_fit_after(CLI::App& sub, ReconstructOptions& o) {
  const OptionGroup in(sub, "Fitting");
  sub.add_flag("--refine", o.refine,
               "Then fit the scene to the pictures, as `vsplat fit --start network` does: to those of --views if "
               "given, else to all");
  sub.add_option("--refine-steps", o.fit.steps, "Number of steps (default: auto, by the number of views)")
      ->type_name("N|auto");
  sub.add_option("--refine-time,--time", o.fit.seconds,
                 "Time limit, measuring included: no step is begun that would end after it")
      ->type_name("SECONDS");
  sub.add_option("--refine-size", o.fit.size, "Pixels of the pictures' longer side (default: 512)")
      ->type_name("N|full");
  sub.add_option("--refine-sheet", o.fit.sheet,
                 "A row for each held-out picture: picture, the network's result, the fit's result, 4 x difference")
      ->type_name("FILE.png");
}

void add_extras(CLI::App& sub, ReconstructOptions& o) {
  const OptionGroup in(sub, "More");
  sub.add_option("--write-views", o.write_views, "Write the network's input: pictures and cameras.json")
      ->type_name("DIR");
  sub.add_option("--write-selection", o.write_selection, "Write the selected voxels as text")->type_name("FILE");
  sub.add_option("--selection", o.selection, "Use the voxels in this file, whatever the network would select")
      ->type_name("FILE");
  sub.add_option("--selection-seed", o.selection_seed, "Add noise with this seed to the selection (default: no noise)")
      ->type_name("S");
  sub.add_option("--near", o.pictures.near, "Near plane, world units (default: 0.2 times the cube's edge)")
      ->type_name("Z");
  sub.add_option("--dump", o.dump, "Write the result of every stage as safetensors")->type_name("DIR");
  sub.add_flag("--dry-run", o.dry_run, "Only print how much memory each stage would take");
  sub.add_option("--assume-selected", o.assume_selected,
                 "Share of the voxels that memory is planned for (default: " + share_text(VSPLAT_ASSUME_SELECTED) + ")")
      ->type_name("F");
}

// Added after all options that apply only to a single set of views.
void add_list(CLI::App& sub, ReconstructOptions& o) {
  const std::vector<std::string> with = {
      "--help",  "--model", "--output", "--pictures", "--skip-bad", "--view-count",     "--auto-frame",     "--center",
      "--scale", "--crop",  "--force",  "--near",     "--up",       "--selection-seed", "--assume-selected"};
  std::vector<CLI::Option*> others;
  for (CLI::Option* option : sub.get_options())
    if (std::none_of(with.begin(), with.end(), [&](const std::string& name) { return option->check_name(name); }))
      others.push_back(option);
  const OptionGroup in(sub, "Many objects");
  CLI::Option* list =
      sub.add_option("--list", o.list,
                     "A text file (or - for stdin) with one VIEWS per line, as on the command line, optionally "
                     "followed by a tab and the scene's name. Each scene becomes DIR/NAME.ply. Objects that cannot be "
                     "read are reported at the end, after the others are made. --device takes several devices")
          ->type_name("FILE");
  for (CLI::Option* other : others) list->excludes(other);
  sub.add_flag("--skip-existing", o.skip_existing, "With --list: skip objects whose scene already exists");
}

}  // namespace

void add_reconstruct(CLI::App& app, Run& run) {
  auto o = std::make_shared<ReconstructOptions>();
  CLI::App* sub = app.add_subcommand("reconstruct", "Make a scene from posed pictures");
  sub->add_option("VIEWS", o->views,
                  "Posed pictures: transforms.json, cameras.json, a COLMAP model, or a folder with one of these")
      ->type_name("VIEWS");
  sub->add_option("-m,--model", o->model, "The model file (default: the built-in model)")->type_name("MODEL");
  sub->add_option("-o,--output", o->output,
                  "The scene to write, or its page (.html); with --list, the folder for the scenes")
      ->type_name("SCENE|DIR");
  sub->add_option("--views", o->names,
                  "Which pictures: names (stem or path) or @ and place in the list from 0; the first is the reference "
                  "(default: well-spread ones, as many as --view-count says)")
      ->type_name("NAME,...|@INDEX,...");
  sub->add_option("--view-count", o->view_count,
                  "Number of pictures to use at most, 1 to 16 (default: what the model's authors found best: "
                  "use_views, else views, of `vsplat weights info`)")
      ->check(CLI::Range(1, 16).description(""))
      ->excludes("--views")
      ->type_name("N");
  sub->add_option("--passes", o->passes,
                  "Number of passes of the network, 1 to 16: each has another picture as the reference, and their mean "
                  "is better than each (default: passes of `vsplat weights info`)")
      ->check(CLI::Range(1, 16).description(""))
      ->type_name("N");
  sub->add_option("--merge-cell", o->merge_cell,
                  "Make one Gaussian of those whose centres share a cell of this edge, in voxels (default: merge_cell "
                  "of `vsplat weights info`)")
      ->type_name("E|none");
  sub->add_option("--fit-epochs", o->fit_epochs,
                  "Number of epochs that then fit the Gaussians to the network's pictures, 0 to 1000: in each, every "
                  "picture gets a step (default: fit_epochs of `vsplat weights info`)")
      ->check(CLI::Range(0, 1000).description(""))
      ->type_name("N");
  add_view_options(*sub, o->picture_folder, o->pictures.skip_bad);
  add_placement_options(*sub, o->placement);
  sub->add_flag("--force", o->force, "Continue even if the cube seems to be behind or outside most views")
      ->group(placement_group);
  add_viewer_option(*sub, o->viewer, "Pictures");
  add_picture_options(*sub, o->pictures, "--render");
  add_fit_after(*sub, *o);
  add_extras(*sub, *o);
  add_list(*sub, *o);
  add_common(*sub, o->common, {.precision = true, .automatic_precision = true});
  sub->footer(
      "Examples:\n"
      "  vsplat reconstruct photos/ --output scene.ply --render orbit:8 --sheet sheet.png\n"
      "  vsplat reconstruct photos/ --output sharp.ply --refine --viewer sharp.html\n"
      "  vsplat reconstruct photos/transforms.json --model model.safetensors --output scene.ply \\\n"
      "         --views 20,25,29,32 --center -0.1,-0.1,-2.5 --scale 1.2 --render orbit:8 --images pictures/\n"
      "  vsplat reconstruct colmap/ --pictures photos/ --output scene.ply --auto-frame\n"
      "  vsplat reconstruct photos/ --model model.safetensors --dry-run\n"
      "  vsplat reconstruct --list objects.txt --output scenes/ --device all --skip-existing\n"
      "The scene has the world coordinates of your cameras. Pictures may be PNG, JPEG, EXR, TIFF, WebP or BMP;\n"
      "what alpha or a mask marks as background becomes white.\n"
      "Axes: transforms.json holds camera-to-world matrices with OpenGL axes, COLMAP and cameras.json hold\n"
      "world-to-camera matrices with x right, y down, z forward.");
  sub->callback([o, &run] { run = [o] { reconstruct(*o); }; });
}

}  // namespace command
