// vsplat convert: converts a scene for programs that do not support its kind.
#include <nlohmann/json.hpp>

#include "scene_file.h"

namespace command {
namespace {

struct ConvertOptions {
  Common common;
  std::string scene, output;
  double thickness = 0;
};

void convert(const ConvertOptions& o) {
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.scene);
  SceneFile file(outputs, o.output);
  const vsplat::Scene given = vsplat::Scene::load(o.scene);
  if (!given.info().surfels)
    throw UsageError(o.scene + ": its Gaussians have three scales each already; a scene of surfels is expected");
  const vsplat::Scene scene = given.surfels_to_gaussians(o.thickness);
  file.save(o.common, scene);
  outputs.commit();
  const uint64_t count = scene.info().count;
  say(o.common, o.output + ": " + std::to_string(count) + " Gaussians of " + o.scene + "'s surfels");
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"output", o.output}, {"gaussians", count}, {"thickness", o.thickness}};
  file.add_results(out);
  print_json(out);
}

}  // namespace

void add_scene_convert(CLI::App& app, Run& run) {
  auto o = std::make_shared<ConvertOptions>();
  CLI::App* sub = app.add_subcommand(
      "convert", "Turn a scene of surfels into one of Gaussians, for programs that cannot draw surfels");
  sub->add_option("scene", o->scene, "A PLY file of surfels, which have two scales each")
      ->required()
      ->type_name("SCENE.ply");
  sub->add_option(
         "--surfels-to-gaussians", o->thickness,
         "Give each surfel a third standard deviation: this share, above 0 and at most 1, of the smaller of its two")
      ->required()
      ->type_name("THICKNESS");
  sub->add_option("-o,--output", o->output, "The scene to write")->required()->type_name("SCENE.ply");
  add_common(*sub, o->common, {.device = false, .profile = false, .outside = false});
  sub->footer(
      "A Gaussian that is seen edge on is smeared over a pixel, and a surfel is not: the pictures are similar, not\n"
      "equal. With 0.1 or less they change little.\n"
      "Example:\n"
      "  vsplat convert surfels.ply --surfels-to-gaussians 0.05 --output scene.ply");
  sub->callback([o, &run] { run = [o] { convert(*o); }; });
}

}  // namespace command
