// vsplat render: pictures of a scene from its file.
#include <nlohmann/json.hpp>

#include "naming.h"
#include "picture_files.h"
#include "scene_file.h"
#include "scene_page.h"

namespace command {
namespace {

struct RenderOptions {
  Common common;
  PictureOptions pictures;
  std::string scene, viewer;
  bool dry_run = false;
};

nlohmann::ordered_json skipped_json(const vsplat_scene_info& info) {
  return {{"not_finite", info.skipped_not_finite},
          {"huge_scale", info.skipped_huge_scale},
          {"zero_rotation", info.skipped_zero_rotation}};
}

void dry_run(const RenderOptions& o, Session& session, const vsplat::Scene& scene,
             const std::vector<vsplat_camera>& cameras) {
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  options.near_plane = PictureJob(o.pictures).near;
  options.exact_tiles = o.pictures.exact_tiles;
  options.supersample = PictureJob(o.pictures).supersample;
  options.antialias = PictureJob(o.pictures).antialias;
  options.progress = &Session::on_progress;
  options.user = &session;
  session.start("counting");
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  vsplat::check(
      vsplat_plan_scene(session.device().get(), scene.get(), cameras.data(), cameras.size(), &options, &plan));
  constexpr uint64_t encoding = 8;  // bytes a pixel: rounded values, and the encoded file
  uint64_t most = 0;
  for (const vsplat_camera& camera : cameras)
    most = std::max(most, static_cast<uint64_t>(camera.width) * static_cast<uint64_t>(camera.height));
  add_host_memory(plan, encoding * most, session.device());
  print_plans(o.common, {{std::to_string(scene.info().count) + " Gaussians, " + std::to_string(cameras.size()) +
                              (cameras.size() == 1 ? " picture" : " pictures"),
                          plan}});
}

void print_results(const RenderOptions& o, const Session& session, const PictureJob& job, const PageFile& page,
                   const vsplat::Scene& scene, std::size_t count, const std::optional<Comparison>& comparison) {
  if (comparison) say(o.common, comparison->table());
  say(o.common, job.summary(count) + " of " + std::to_string(scene.info().count) + " Gaussians, " +
                    seconds_text(elapsed_seconds()));
  if (!o.common.json) return;
  nlohmann::ordered_json files = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < count && !job.images.empty(); ++i) files.push_back(job.file(i));
  nlohmann::ordered_json out = {
      {"gaussians", scene.info().count}, {"skipped", skipped_json(scene.info())}, {"images", files}};
  page.add_results(out);
  job.add_results(comparison, out);
  session.add_numerics(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

// The page alone, which needs no device.
void write_page_alone(const RenderOptions& o) {
  if (wants_times(o.common) || !o.pictures.near.empty() || !o.pictures.antialias.empty() || o.pictures.exact_tiles)
    throw UsageError(
        "--profile, --trace, --near, --antialias and --exact-tiles apply to pictures that are drawn: they need "
        "--cameras");
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.scene);
  PageFile page(outputs, "", o.viewer, {});
  const vsplat::Scene scene = load_scene(o.scene, o.pictures.skip_bad);
  page.save(o.common, {{"scene", scene, o.scene}});
  outputs.commit();
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"gaussians", scene.info().count}, {"skipped", skipped_json(scene.info())}};
  page.add_results(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

void render(const RenderOptions& o) {
  const PictureJob job(o.pictures);
  if (o.dry_run) refuse_profile_of_dry_run(o.common);
  if (!job.wanted && !job.written && !o.viewer.empty() && !o.dry_run) return write_page_alone(o);
  if (!job.wanted) throw UsageError("render needs --cameras");
  if (job.orbit_options.has_up && !job.choice.orbit)
    throw UsageError("--up applies to cameras on a circle: it needs orbit:N");
  if (!job.written && o.viewer.empty() && !o.dry_run)
    throw UsageError(
        "render needs --images, the folder for the pictures, or --sheet, --turntable, --compare, --write-cameras or "
        "--viewer");
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.scene);
  outputs.input_cameras(job.choice.file);
  outputs.expect(o.common.profile);
  outputs.expect(o.common.trace);
  PageViews views{job.choice.path ? "" : job.choice.file, job.compare};
  std::copy(std::begin(job.background), std::end(job.background), views.background);
  PageFile page(outputs, "", o.viewer, views);
  Shots shots;
  if (!job.choice.orbit) shots = job.load_cameras();
  if (!o.dry_run) job.expect(outputs, job.choice.orbit ? static_cast<std::size_t>(job.choice.orbit) : shots.all.size());
  const vsplat::Scene scene = load_scene(o.scene, o.pictures.skip_bad);
  if (job.choice.orbit) {
    const vsplat_scene_info info = scene.info();
    if (!job.orbit_options.has_up && !is_set(info.up))
      say(o.common, o.scene + " does not say which way is up: -y is used (--up 0,0,1 for scenes that stand on xy)");
    shots.listed = naming({o.scene}, {}, [&] { return scene.orbit(job.orbit_options); });
    shots.all = shots.listed.all();
  }
  std::optional<Comparison> comparison;
  if (!o.dry_run) comparison = job.prepare(shots, outputs);

  Session session(o.common, o.dry_run ? Devices::one : Devices::several);
  if (o.dry_run) return dry_run(o, session, scene, shots.all);
  session.about("command", "render");
  session.about("scene", o.scene);
  job.draw(session, scene, shots.all, comparison, outputs);
  page.save(o.common, {{"scene", scene, o.scene}});
  session.write_profile(outputs);
  outputs.commit();
  print_results(o, session, job, page, scene, shots.all.size(), comparison);
}

}  // namespace

void add_render(CLI::App& app, Run& run) {
  auto o = std::make_shared<RenderOptions>();
  CLI::App* sub = app.add_subcommand("render", "Draw pictures of a scene");
  sub->add_option("scene", o->scene, "A scene file in any supported format")->required()->type_name("SCENE");
  add_picture_options(*sub, o->pictures, "--cameras");
  add_viewer_option(*sub, o->viewer, "Pictures");
  sub->add_option("--near", o->pictures.near, "Near plane, world units (default: the file's, else 0.2)")
      ->type_name("Z")
      ->group("Pictures");
  sub->add_option("--antialias", o->pictures.antialias,
                  "Whether what is smaller than a pixel fades instead of growing (default: auto, as the file says)")
      ->check(one_of({"auto", "on", "off"}))
      ->type_name("auto|on|off")
      ->group("Pictures");
  sub->add_flag("--skip-bad", o->pictures.skip_bad,
                "Leave out and count Gaussians that cannot be drawn (NaN, infinite, a rotation of length 0), cameras "
                "that cannot be used, and pictures of --compare that are missing or cannot be read");
  sub->add_flag("--exact-tiles", o->pictures.exact_tiles,
                "Draw a Gaussian only in the tiles that its ellipse reaches: the same pictures, faster if many "
                "Gaussians are thin")
      ->group("Pictures");
  sub->add_flag("--dry-run", o->dry_run, "Only print how much memory it would take");
  add_common(*sub, o->common);
  sub->footer(
      "Examples:\n"
      "  vsplat render scene.ply --cameras orbit:24 --images turn/\n"
      "  vsplat render scene.ply --cameras orbit:72 --turntable turn.webp --sheet sheet.png\n"
      "  vsplat render scene.ply --viewer scene.html\n"
      "  vsplat render scene.ply --cameras path:keys.json:120 --size 1280x720 --turntable flight.webp --fps 30\n"
      "  vsplat render scene.ply --cameras photos/transforms.json --compare photos/images --differences off/ --json\n"
      "  vsplat render scene.ply --cameras photos/transforms.json --images again/ --size 640x480 --background black\n"
      "  vsplat render scene.ply --cameras orbit:1 --up 0,0,1 --orbit-elevation -10 --images x/ --format exr\n"
      "  vsplat render scene.ply --cameras orbit:24 --images set/ --background transparent --write-cameras "
      "set/cameras.json\n"
      "orbit:N is a circle around the scene, with all of it in each picture; up comes from the file, else it is -y.\n"
      "path:CAMERAS:N begins at the first camera of CAMERAS, ends at the last one and passes through all between,\n"
      "around the point that they look at if there is one.\n"
      "--compare: pictures with alpha or masks are put over --background, and lens distortion is undone. SSIM takes\n"
      "11 x 11 Gaussian windows, sigma 1.5. With --json, null is the PSNR of equal pictures, which is infinite, or\n"
      "the SSIM of a picture that is too small for a window.\n"
      "cameras.json: [{\"file\", \"w\", \"h\", \"fx\", \"fy\", \"cx\", \"cy\", \"w2c\": 4x4}, ...], x right, y down, z "
      "forward.");
  sub->callback([o, &run] { run = [o] { render(*o); }; });
}

}  // namespace command
