// vsplat convert: scenes from one format, frame or kind to another.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <vector>

#include "arguments.h"
#include "scene_changes.h"
#include "scene_check.h"
#include "scene_file.h"
#include "scene_page.h"
#include "session.h"

namespace command {
namespace {

struct ConvertOptions {
  Common common;
  ChangeOptions changes;
  std::vector<std::string> paths;  // the inputs, and the output if `output` is empty
  std::string output, spz_version, viewer;
  std::optional<double> thickness;  // surfels get this third scale
  std::string verify;               // "", "true" without a value, or the least PSNR
  bool skip_bad = false;
};

// Splits the paths into inputs and output.
void name_output(ConvertOptions& o) {
  if (o.output.empty()) {
    if (o.paths.size() < 2)
      throw UsageError("convert needs the scene to write, after those to read: vsplat convert IN... OUT");
    o.output = o.paths.back();
    o.paths.pop_back();
  }
  if (!is_page(o.output)) need_scene_ending("OUT", o.output);
}

// The limit of --verify; nothing if it was not given.
std::optional<double> least_psnr(const std::string& verify) {
  constexpr double usual = 30;
  if (verify.empty()) return std::nullopt;
  const double out = verify == "true" ? usual : number("--verify", verify);
  if (out < 0) throw UsageError("--verify is \"" + verify + "\": a PSNR in dB of 0 or more expected");
  return out;
}

// All inputs in one scene.
vsplat::Scene merged(const ConvertOptions& o) {
  vsplat_scene_load_options options = VSPLAT_SCENE_LOAD_OPTIONS_INIT;
  options.skip_bad = o.skip_bad;
  std::optional<vsplat::Scene> out;
  for (const std::string& path : o.paths) {
    vsplat::Scene scene = vsplat::Scene::load(path, options);
    if (o.thickness) {
      if (!scene.info().surfels)
        throw UsageError(path + ": its Gaussians have three scales each already; a scene of surfels is expected");
      scene = scene.surfels_to_gaussians(*o.thickness);
    }
    if (out)
      out->append(scene);
    else
      out = std::move(scene);
  }
  return std::move(*out);
}

vsplat::Scene copy_of(const vsplat::Scene& scene) {
  vsplat::Scene out = vsplat::Scene::create(vsplat::ConstGaussianSpans{}, 0);
  out.append(scene);
  return out;
}

void keep_visible(Session& session, vsplat::Scene& scene, uint64_t most) {
  vsplat_scene_keep_visible_options options = VSPLAT_SCENE_KEEP_VISIBLE_OPTIONS_INIT;
  options.max_gaussians = most;
  options.progress = &Session::on_progress;
  options.user = &session;
  session.start("reducing");
  vsplat::keep_visible(session.device(), scene, options);
  clear_progress();
}

// The bytes of the file, read back and compared with the scene; std::runtime_error if they are too far off.
std::vector<unsigned char> verified_bytes(const ConvertOptions& o, Session& session, const vsplat::Scene& original,
                                          const vsplat::Scene& scene, const vsplat_scene_save_options& saving,
                                          double least, std::optional<SceneCheck>& check) {
  std::vector<unsigned char> out = scene.save_memory(saving);
  check.emplace(session, original, scene, vsplat::Scene::load(out));
  if (!(check->psnr() >= least)) {
    char limit[32];
    std::snprintf(limit, sizeof limit, "%.4g dB", least);
    throw std::runtime_error(o.output + " is not written, since it differs too much: at least " + limit +
                             " expected, found " + check->text());
  }
  say(o.common, o.output + ": " + check->text());
  return out;
}

void convert(ConvertOptions o) {
  name_output(o);
  SceneChanges changes(o.changes);
  const std::optional<double> least = least_psnr(o.verify);
  vsplat_scene_save_options saving = VSPLAT_SCENE_SAVE_OPTIONS_INIT;
  if (!o.spz_version.empty()) saving.spz_version = static_cast<int32_t>(number("--spz-version", o.spz_version));

  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : o.paths) outputs.input(path);
  SceneFile file(outputs, o.output);
  PageFile page(outputs, o.output, o.viewer, {});
  vsplat::Scene scene = merged(o);
  changes.apply(o.common, scene);
  const uint64_t before = scene.info().count;
  std::optional<Session> session;
  const bool reduces = changes.max_gaussians() > 0 && before > changes.max_gaussians();
  if (reduces || least) session.emplace(o.common);
  // --verify compares with the scene before it is reduced.
  const vsplat::Scene original = least && (reduces || changes.reduces_sh(scene)) ? copy_of(scene) : scene;
  if (changes.reduces_sh(scene)) changes.reduce_sh(scene);
  if (reduces) keep_visible(*session, scene, changes.max_gaussians());
  const vsplat_scene_info info = scene.info();
  if (info.count < before)
    say(o.common, std::to_string(before - info.count) + " of " + std::to_string(before) +
                      " Gaussians are left out as the least visible");
  const std::string format = is_page(o.output) ? "spz" : file.format();  // a page holds an SPZ file
  saving.format = format.c_str();
  std::optional<SceneCheck> check;
  std::vector<unsigned char> bytes;
  if (least) bytes = verified_bytes(o, *session, original, scene, saving, *least, check);
  file.save(o.common, scene, saving, least ? &bytes : nullptr);
  page.save(o.common, {{"scene", scene}});
  outputs.commit();
  say(o.common, o.output + ": " + std::to_string(info.count) + (info.surfels ? " surfels" : " Gaussians"));
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"output", o.output},
                                {"format", is_page(o.output) ? "html" : format},
                                {"gaussians", info.count},
                                {"sh_degree", info.sh_degree}};
  if (o.thickness) out["thickness"] = *o.thickness;
  changes.add_results(out);
  out["removed"]["least_visible"] = before - info.count;
  file.add_results(out);
  page.add_results(out);
  if (check) check->add_results(*least, out);
  print_json(out);
}

}  // namespace

void add_scene_convert(CLI::App& app, Run& run) {
  auto o = std::make_shared<ConvertOptions>();
  CLI::App* sub = app.add_subcommand(
      "convert", "Write scenes in another format, along other axes, cropped, reduced or merged, and check the result");
  sub->add_option("scenes", o->paths, "The scenes to read, several become one; then the scene to write")
      ->required()
      ->type_name("SCENE...");
  sub->add_option("-o,--output", o->output, "The scene to write, where it is not the last of SCENE...")
      ->type_name("SCENE");
  sub->add_option("--spz-version", o->spz_version, "Version of an SPZ file, for programs that do not read the newest")
      ->check(one_of({"2", "3", "4"}))
      ->type_name("2|3|4");
  sub->add_flag(
      "--verify", o->verify,
      "Read the file back, draw it beside the original from eight cameras, and write it only if the PSNR is at "
      "least 30 dB, or --verify=DB");
  sub->add_option("--surfels-to-gaussians", o->thickness,
                  "Give each surfel a third standard deviation: this share, above 0 and at most 1, of the smaller of "
                  "its two; for programs that cannot draw surfels")
      ->type_name("THICKNESS");
  sub->add_flag("--skip-bad", o->skip_bad,
                "Leave out, and count, single Gaussians that cannot be drawn (NaN, infinite, a rotation of length 0)");
  add_viewer_option(*sub, o->viewer, "Files");
  add_change_options(*sub, o->changes);
  add_common(*sub, o->common, {.profile = false, .outside = false});
  sub->footer(
      "The output's ending names its format. What a format cannot keep is told; with --verify, how far values are "
      "off.\n"
      "A device is used only for --verify and --max-gaussians.\n"
      "Examples:\n"
      "  vsplat convert scene.ply scene.spz --verify\n"
      "  vsplat convert scene.ply small.spz --sh 1 --max-gaussians 200000 --verify=28\n"
      "  vsplat convert scan.ply unity.ply --from RFU --to RUF --remove-floaters --min-opacity 0.005\n"
      "  vsplat convert room.ply chair.ply both.ply --crop-box -2,-2,-2,2,2,2\n"
      "  vsplat convert surfels.ply --surfels-to-gaussians 0.05 --output scene.ply\n"
      "A surfel seen edge on shows nothing, and a Gaussian is smeared over a pixel: the pictures are similar, not "
      "equal.");
  sub->callback([o, &run] { run = [o] { convert(*o); }; });
}

}  // namespace command
