// vsplat fit: fits a scene to the user's own pictures, and measures it on held-out views.
#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "arguments.h"
#include "fit_job.h"
#include "placement_options.h"
#include "scene_file.h"

namespace command {
namespace {

struct FitSettings {
  Common common;
  PlacementOptions placement;
  FitOptions fit;
  std::string views, start = "auto", model, output, names, picture_folder, near;
  int view_count = 0;  // 0: the model's
  bool object = false, scene = false, force = false, dry_run = false, skip_bad = false;
};

// Parses --start; a file with one of these names is written ./NAME.
vsplat_fit_start start_of(const std::string& text) {
  return text == "auto"      ? VSPLAT_FIT_AUTO
         : text == "network" ? VSPLAT_FIT_NETWORK
         : text == "points"  ? VSPLAT_FIT_POINTS
         : text == "random"  ? VSPLAT_FIT_RANDOM
                             : VSPLAT_FIT_SCENE;
}

// Whether it begins with what the network makes, or may do so.
bool uses_network(const FitSettings& o) {
  const vsplat_fit_start start = start_of(o.start);
  return start == VSPLAT_FIT_NETWORK || (start == VSPLAT_FIT_AUTO && !o.scene);
}

void check(const FitSettings& o) {
  if (o.output.empty() && !o.dry_run) throw UsageError("fit needs --output, the scene's file");
  need_ending("--output", o.output, ".ply");
  if (o.object && o.scene) throw UsageError("--object and --scene exclude each other");
  if (!uses_network(o)) {
    if (!o.model.empty()) throw UsageError("--model is for --start network");
    if (o.view_count) throw UsageError("--view-count is for --start network");
    if (o.placement.crop != "auto") throw UsageError("--crop is for --start network");
  }
}

// The scene to start from.
vsplat::Scene start_scene(const std::string& path) {
  vsplat::Scene out = vsplat::Scene::load(path);
  if (out.info().surfels)
    throw UsageError(path + " holds surfels, but only Gaussians of three scales can be fitted: vsplat convert " +
                     "--surfels-to-gaussians makes them");
  if (out.info().count == 0) throw std::runtime_error(path + " has no Gaussian: there is nothing to fit");
  return out;
}

std::string start_file(const FitSettings& o) { return start_of(o.start) == VSPLAT_FIT_SCENE ? o.start : ""; }

// Plans the memory at the largest size: --max-gaussians, else the larger of 1.5 Gaussians a pixel of a picture and
// twice the start's.
void dry_run(const FitSettings& o, const FitJob& job) {
  Session session(o.common);
  // The presets of vsplat_fit_quality.
  constexpr int of_quality[] = {512, 1024, 1600};
  const int longest = job.options.longest < 0 ? of_quality[job.options.quality] : job.options.longest;
  const int unknown = longest > 0 ? longest : 1600;
  vsplat_cameras_options read = VSPLAT_CAMERAS_OPTIONS_INIT;
  read.width = read.height = unknown;
  read.skip_bad = o.skip_bad;
  const std::vector<vsplat_camera> cameras = vsplat::Cameras::load(o.views, read).all();
  std::uint64_t begins = 0;
  int degree = 2;
  std::vector<Plan> plans;
  if (job.options.start == VSPLAT_FIT_SCENE) {
    const vsplat_scene_info info = start_scene(o.start).info();
    begins = info.count;
    degree = std::max(degree, info.sh_degree);
  } else if (job.options.start == VSPLAT_FIT_NETWORK) {
    const vsplat::Model model = load_model(o.model);
    begins = static_cast<std::uint64_t>(VSPLAT_ASSUME_SELECTED * static_cast<double>(model.info().max_gaussians));
    degree = std::max(degree, model.info().sh_degree);
    vsplat_plan plan = VSPLAT_PLAN_INIT;
    const int32_t views = o.view_count ? o.view_count : model.info().use_views;
    vsplat::check(vsplat_plan_reconstruct(session.device().get(), model.get(),
                                          std::min(views, static_cast<int32_t>(cameras.size())), VSPLAT_ASSUME_SELECTED,
                                          &plan));
    plans.push_back({"the network before it", plan});
  }
  double pixels = 1;
  for (const vsplat_camera& c : cameras) {
    const double longer = std::max(c.width, c.height);
    const double scale = longest > 0 ? std::min(1.0, longest / longer) : 1;
    pixels = std::max(pixels, scale * scale * c.width * c.height);
  }
  const std::uint64_t grows = job.options.max_gaussians > 0
                                  ? job.options.max_gaussians
                                  : std::max(2 * begins, static_cast<std::uint64_t>(1.5 * pixels));
  if (job.options.sh_degree >= 0) degree = job.options.sh_degree;
  plans.push_back(plan_fit(session, std::max(begins, grows), degree, cameras, longest));
  print_plans(o.common, plans);
}

void fit(const FitSettings& o) {
  check(o);
  FitJob job(o.fit);
  job.from = o.views;
  job.options.start = start_of(o.start);
  vsplat_input_options input = VSPLAT_INPUT_OPTIONS_INIT;
  set_placement(o.placement, input);
  input.force = o.force;
  input.view_count = o.view_count;
  job.options.input = &input;
  vsplat_reconstruct_options network = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  if (!o.near.empty()) job.options.near_plane = positive_number("--near", o.near, "distance in world units");
  network.near_plane = job.options.near_plane;
  job.options.extent = o.object ? VSPLAT_EXTENT_OBJECT : o.scene ? VSPLAT_EXTENT_SCENE : VSPLAT_EXTENT_AUTO;
  job.options.reconstruct = &network;
  std::vector<std::string> names;
  if (!o.names.empty()) names = list("--views", o.names);
  std::vector<const char*> name_pointers;
  name_pointers.reserve(names.size());
  for (const std::string& name : names) name_pointers.push_back(name.c_str());
  job.options.names = name_pointers.empty() ? nullptr : name_pointers.data();
  job.options.num_names = name_pointers.size();
  set_up_library(o.common);
  if (o.dry_run) return dry_run(o, job);

  Outputs outputs(o.common.overwrite);
  const vsplat::Views views = vsplat::Views::load(o.views, views_options(o.picture_folder, o.skip_bad, !names.empty()));
  for (const std::string& path : {start_file(o), o.model}) outputs.input(path);
  for (const std::string& path : views.files()) outputs.input(path);
  SceneFile file(outputs, o.output);
  for (const std::string& path : {o.common.profile, o.common.trace}) outputs.expect(path);
  job.expect(outputs, o.output);

  vsplat::Scene scene;
  if (job.options.start == VSPLAT_FIT_SCENE) scene = start_scene(o.start);
  job.options.scene = scene.get();
  Session session(o.common);
  session.about("command", "fit");
  if (uses_network(o)) session.about("model", model_name(o.model));
  session.about("scene", o.views);
  vsplat::Model model;
  if (uses_network(o)) model = load_model(o.model);
  job.options.model = model.get();
  const vsplat::Scene result = job.run(session, o.common, views, outputs);
  file.save(o.common, result);
  session.write_profile(outputs);
  outputs.commit();
  job.summarise(o.common);
  say(o.common,
      o.output + ": " + std::to_string(result.info().count) + " Gaussians, " + seconds_text(elapsed_seconds()));
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"output", o.output}, {"gaussians", result.info().count}};
  file.add_results(out);
  job.add_results(out);
  session.add_numerics(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

void add_fit_options(CLI::App& sub, FitOptions& o) {
  sub.add_option(
         "--quality", o.quality,
         "Number of steps and pixels of the pictures' longer side: draft 2,000 and 512, normal 7,000 and 1,024, "
         "high 30,000 and 1,600 (default: draft)")
      ->check(one_of({"draft", "normal", "high"}))
      ->type_name("draft|normal|high");
  sub.add_option("--steps", o.steps,
                 "Number of steps (default: auto, by --quality; for an object with few views, the number that was "
                 "best for the views left out in turn)")
      ->type_name("N|auto");
  sub.add_option("--time", o.seconds, "Time limit: no step begins that would end later, judging included")
      ->type_name("SECONDS");
  sub.add_option(
         "--holdout", o.holdout,
         "Which pictures are held out to judge the scene (default: auto, every eighth of 12 or more, of a whole "
         "scene of 5 or more; with fewer, each is left out in turn, or none for a whole scene)")
      ->type_name("auto|none|N|NAME,...");
  sub.add_option("--size", o.size, "Pixels of the pictures' longer side (default: by --quality)")->type_name("N|full");
  const char* what = "The scene";
  sub.add_option("--max-gaussians", o.max_gaussians,
                 "Number of Gaussians that it may grow to (default: by the pictures; with fewer than 12 pictures it "
                 "does not grow)")
      ->type_name("N")
      ->group(what);
  sub.add_option(
         "--strategy", o.strategy,
         "Where it grows: mcmc adds Gaussians where opaque ones are, error splits what covers the pictures' errors "
         "(default: mcmc)")
      ->check(one_of({"mcmc", "error"}))
      ->type_name("mcmc|error")
      ->group(what);
  sub.add_option("--consolidate", o.consolidate,
                 "Share of its Gaussians that stays after the steps, the most visible ones; 300 more steps follow")
      ->type_name("SHARE")
      ->group(what);
  sub.add_option("--sh", o.sh, "Degree of its view-dependent colour (default: the start's, at least 2 with many views)")
      ->check(one_of({"0", "1", "2", "3"}))
      ->type_name("0..3")
      ->group(what);
  sub.add_option("--freeze", o.freeze, "Which parameters stay as they are, of means, scales, rotations, opacities, sh")
      ->type_name("NAME,...")
      ->group(what);
  sub.add_flag("--antialias", o.antialias,
               "Fit for drawing at any size: what is smaller than a pixel fades instead of growing. The file says so, "
               "and render obeys it")
      ->group(what);
  sub.add_option("--seed", o.seed, "Seed of the pictures' order, of backgrounds, growth and --start random (0)")
      ->type_name("S")
      ->group(what);
}

}  // namespace

void add_fit(CLI::App& app, Run& run) {
  auto o = std::make_shared<FitSettings>();
  CLI::App* sub = app.add_subcommand("fit", "Fit a scene to its pictures, and measure the gain on held-out views");
  sub->add_option("VIEWS", o->views,
                  "transforms.json, cameras.json, a COLMAP model, or a folder holding one, with pictures")
      ->required()
      ->type_name("VIEWS");
  sub->add_option("--start", o->start,
                  "What it begins with: a scene, what the network makes, COLMAP's points, or points at random (a file "
                  "of such a name is ./NAME). Default: auto, a whole scene's points, or random ones if there are none; "
                  "for an object the network with fewer than 12 pictures, else the points, else random ones")
      ->type_name("SCENE.ply|network|points|random|auto");
  sub->add_flag("--scene", o->scene,
                "Fit the whole scene that the pictures show (default, unless they have masks or alpha, or a cube is "
                "given)");
  sub->add_flag("--object", o->object, "Fit an object: what lies outside its cube is white");
  sub->add_option("-o,--output", o->output, "The scene to write")->type_name("SCENE.ply");
  sub->add_option("--views", o->names,
                  "Which pictures are used: names (stem or path) or @ and place in the list from 0 (default: all)")
      ->type_name("NAME,...|@INDEX,...");
  add_view_options(*sub, o->picture_folder, o->skip_bad);
  add_fit_options(*sub, o->fit);
  sub->add_option("-m,--model", o->model, "The model of --start network (default: the built-in model)")
      ->type_name("MODEL");
  sub->add_option("--near", o->near,
                  "Near plane, world units (default: the start's; for an object 0.2 times its cube's edge, for a whole "
                  "scene a hundredth of the distance to its nearest points)")
      ->type_name("Z");
  sub->add_option("--view-count", o->view_count,
                  "How many of the fitted pictures the network of --start network gets, well spread, 1 to 16 (default: "
                  "what the model's makers measured to be best)")
      ->check(CLI::Range(1, 16).description(""))
      ->type_name("N");
  add_placement_options(*sub, o->placement);
  sub->add_flag("--force", o->force, "Continue even if the cube seems to be behind or outside most views")
      ->group(placement_group);
  const char *beside = "Beside the scene", *behind = "Background and masks";
  sub->add_option("--sheet", o->fit.sheet,
                  "A row for each held-out picture: picture, start, result, 4 x difference; for fitted pictures if "
                  "none is held out")
      ->type_name("FILE.png")
      ->group(beside);
  sub->add_option("--log", o->fit.log, "Every step: phase, loss, Gaussians, PSNR held out, seconds")
      ->type_name("FILE.csv")
      ->group(beside);
  sub->add_option("--background", o->fit.background,
                  "What is behind the scene where it lets light through, while fitting and measuring: a colour as in "
                  "`render`; random, another colour in every step, which leaves no holes (measured over black); sky, "
                  "fitted, too, and written as Gaussians on a far sphere (default: auto, sky for a whole scene; for an "
                  "object white, with a random colour in every other step of masked pictures)")
      ->type_name("COLOUR|random|sky|auto")
      ->group(behind);
  sub->add_option("--masks", o->fit.masks,
                  "What is outside the masks: object, nothing (default); ignore, things that take no part in fitting "
                  "and measuring, like people who walk past. Alpha always marks the object")
      ->check(one_of({"object", "ignore"}))
      ->type_name("object|ignore")
      ->group(behind);
  sub->add_flag("--invert-masks", o->fit.invert_masks, "Masks are black inside, not white")->group(behind);
  sub->add_flag("--poses", o->fit.poses,
                "Correct the cameras a little, too, and write them as cameras.json beside the scene: SCENE.poses.json")
      ->group(beside);
  sub->add_flag("--exposure", o->fit.exposure,
                "Give each picture an affine map of colours while fitting, for differing exposure; the maps are "
                "dropped at the end")
      ->group(beside);
  sub->add_option("--checkpoint", o->fit.checkpoint, "Folder for the state, which is written from time to time")
      ->type_name("DIR")
      ->group(beside);
  sub->add_flag("--resume", o->fit.resume, "Continue from the state in --checkpoint: the result has the same bytes")
      ->group(beside);
  sub->add_flag("--dry-run", o->dry_run, "Only say how much device memory a step takes")->group(beside);
  add_common(*sub, o->common);
  sub->footer(
      "Examples:\n"
      "  vsplat fit photos/ --start network --output sharp.ply --sheet sheet.png\n"
      "  vsplat fit photos/ --start scene.ply --output sharp.ply --size full --time 120\n"
      "  vsplat fit colmap/ --pictures photos/ --start points --auto-frame --output scene.ply --steps 3000\n"
      "  vsplat fit photos/ --start network --output sharp.ply --poses --exposure\n"
      "  vsplat fit photos/ --start network --output sharp.ply --steps 20000 --checkpoint state/ --resume\n"
      "  vsplat fit photos/ --start points --output place.ply --scale 20 --background sky --masks ignore\n"
      "  vsplat fit photos/ --start scene.ply --output recoloured.ply --freeze means,scales,rotations,opacities\n"
      "The result is never worse than the start on the held-out pictures: if the start is best, it is written, and a\n"
      "message says so. Masks and alpha are used if there are any. Ctrl-C stops with the best scene so far; a second\n"
      "one stops at once. The same input gives the same bytes, except with --time.");
  sub->callback([o, &run] { run = [o] { fit(*o); }; });
}

}  // namespace command
