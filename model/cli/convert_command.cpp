// vsplat convert: scenes from one format, frame or kind to another.
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <vector>

#include "arguments.h"
#include "naming.h"
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
  std::string output, viewer;
  int32_t spz_version = 0;          // 0: the newest
  std::optional<double> thickness;  // surfels get this third scale
  std::string verify;               // "", "true" without a value, or the least PSNR
  bool skip_bad = false;
};

// Splits the paths into inputs and output.
void name_output(ConvertOptions& o) {
  const std::string option = o.output.empty() ? "OUT" : "--output";
  if (o.output.empty()) {
    if (o.paths.size() < 2)
      throw UsageError("convert needs the scene to write, after those to read: vsplat convert IN... OUT");
    o.output = o.paths.back();
    o.paths.pop_back();
  }
  need_scene_ending(option, o.output, true);
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
  std::optional<vsplat::Scene> out;
  for (const std::string& path : o.paths) {
    vsplat::Scene scene = load_scene(path, o.skip_bad);
    if (o.thickness) {
      if (!scene.info().surfels)
        throw UsageError(path + ": its Gaussians have three scales each already; a scene of surfels is expected");
      scene = scene.surfels_to_gaussians(*o.thickness);
    }
    if (out)
      naming(o.paths, {}, [&] { out->append(scene); });
    else
      out = std::move(scene);
  }
  return std::move(*out);
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

// Says how much the file differs; std::runtime_error if that is too much.
void need_alike(const ConvertOptions& o, const SceneCheck& check, double least) {
  if (!(check.psnr() >= least)) {
    char limit[32];
    std::snprintf(limit, sizeof limit, "%.4g dB", least);
    throw std::runtime_error(o.output + " is not written: a PSNR of at least " + limit + " is required. " +
                             check.text());
  }
  say(o.common, o.output + ": " + check.text());
}

void convert(ConvertOptions o) {
  name_output(o);
  SceneChanges changes(o.changes);
  const std::optional<double> least = least_psnr(o.verify);
  vsplat_scene_save_options saving = VSPLAT_SCENE_SAVE_OPTIONS_INIT;

  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  for (const std::string& path : o.paths) outputs.input(path);
  SceneFile file(outputs, o.output);
  PageFile page(outputs, o.output, o.viewer, {});
  const std::string format = is_page(o.output) ? "spz" : file.format();  // a page holds an SPZ file
  if (o.spz_version && file.format() != "spz")
    throw UsageError("--spz-version applies to SPZ files: " + o.output + " is none");
  saving.format = format.c_str();
  saving.spz_version = is_page(o.output) ? page_spz_version : o.spz_version;
  vsplat::Scene scene = merged(o);
  naming(o.paths, {}, [&] { changes.apply(o.common, scene); });
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
                      " Gaussians are removed, the least visible ones");
  std::optional<SceneCheck> check;
  std::vector<unsigned char> bytes;
  if (least) {
    bytes = naming({o.output}, {}, [&] { return scene.save_memory(saving); });
    check.emplace(*session, original, scene, vsplat::Scene::load(bytes));
    need_alike(o, *check, *least);
  }
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
  CLI::App* sub = app.add_subcommand("convert", "Convert, edit and merge scenes, and check the written file");
  sub->add_option("scenes", o->paths,
                  "The scenes to read, which are merged if there are several, followed by the scene to write")
      ->required()
      ->type_name("SCENE...");
  sub->add_option("-o,--output", o->output, "The scene to write; then all of SCENE... are read")->type_name("SCENE");
  sub->add_option("--spz-version", o->spz_version,
                  "Version of the SPZ file (default: 4); many programs in browsers read only 2 and 3")
      ->check(one_of({"2", "3", "4"}))
      ->type_name("2|3|4");
  sub->add_flag(
      "--verify", o->verify,
      "Draw the scene as the file would hold it and the original, from eight cameras. Write the file only if the PSNR "
      "between them is at least 30 dB; --verify=DB sets another limit");
  sub->add_option("--surfels-to-gaussians", o->thickness,
                  "Turn surfels into Gaussians, for programs that cannot draw surfels. The third standard deviation is "
                  "THICKNESS (above 0, at most 1) times the smaller of the surfel's two")
      ->type_name("THICKNESS");
  sub->add_flag("--skip-bad", o->skip_bad,
                "Leave out Gaussians that cannot be drawn (NaN, infinite, a rotation of length 0), and count them");
  add_viewer_option(*sub, o->viewer, "Files");
  add_change_options(*sub, o->changes);
  add_common(*sub, o->common, {.profile = false, .outside = false});
  sub->footer(
      "The ending of the output's name selects the format. A message lists what that format cannot keep; --verify "
      "also\n"
      "reports how much the values differ. Only --verify and --max-gaussians use a device.\n"
      "Examples:\n"
      "  vsplat convert scene.ply scene.spz --verify\n"
      "  vsplat convert scene.ply small.spz --sh 1 --max-gaussians 200000 --verify=28\n"
      "  vsplat convert scan.ply unity.ply --from RFU --to RUF --remove-floaters --min-opacity 0.005\n"
      "  vsplat convert room.ply chair.ply both.ply --crop-box -2,-2,-2,2,2,2\n"
      "  vsplat convert surfels.ply --surfels-to-gaussians 0.05 --output scene.ply\n"
      "Pictures of surfels and of the Gaussians made from them are similar, not equal: seen edge on, a surfel is\n"
      "invisible and a Gaussian still covers about a pixel.");
  sub->callback([o, &run] { run = [o] { convert(*o); }; });
}

}  // namespace command
