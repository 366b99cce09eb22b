// vsplat poses: the cameras of bare photographs, or of a video's frames, by the user's COLMAP.
#include <nlohmann/json.hpp>

#include "arguments.h"
#include "command.h"
#include "poses_job.h"

namespace command {
namespace {

void find_poses(const PosesOptions& o) {
  set_up_library(o.common);
  const nlohmann::ordered_json result = PosesJob(o).run();
  if (o.common.json) print_json(result);
}

}  // namespace

void add_poses(CLI::App& app, Run& run) {
  auto o = std::make_shared<PosesOptions>();
  CLI::App* sub = app.add_subcommand("poses", "Find the cameras of bare photographs, with COLMAP");
  sub->add_option("pictures", o->pictures,
                  "A folder of photographs (or with a folder images/ or input/ of them), or a video")
      ->required()
      ->type_name("PICTURES|VIDEO");
  sub->add_option("-o,--output", o->output,
                  "The folder to write: pictures, cameras and points, which fit and reconstruct read")
      ->required()
      ->type_name("DIR");
  const std::string group = "How";
  sub->add_option(
         "--frames", o->frames,
         "How many pictures to cut from a video: evenly spread, the sharpest of their neighbours (default: 40)")
      ->check(CLI::Range(3, 100000))
      ->type_name("N")
      ->group(group);
  sub->add_option("--matcher", o->matcher,
                  "Which pictures are compared: all pairs, each with its neighbours by name, or with those that a "
                  "vocabulary tree finds similar (default: auto, by their number and names)")
      ->check(one_of({"auto", "exhaustive", "sequential", "vocabulary"}))
      ->type_name("auto|exhaustive|sequential|vocabulary")
      ->group(group);
  sub->add_option("--vocabulary", o->vocabulary,
                  "COLMAP's vocabulary tree, of the installed version's format (default: one that COLMAP has "
                  "downloaded)")
      ->type_name("FILE")
      ->group(group);
  sub->add_option("--lens", o->lens,
                  "Model of the lenses: opencv has two focal lengths and four distortions, radial one of each "
                  "(default: radial)")
      ->check(one_of({"radial", "opencv", "fisheye"}))
      ->type_name("radial|opencv|fisheye")
      ->group(group);
  sub->add_option("--gpu", o->gpu,
                  "Whether COLMAP uses CUDA (default: auto, if it is built with it and there is a GPU)")
      ->check(one_of({"auto", "on", "off"}))
      ->type_name("auto|on|off")
      ->group(group);
  sub->add_option("--colmap", o->colmap, "COLMAP's program, version 3.8 or later (default: colmap, in PATH)")
      ->type_name("PROGRAM")
      ->group(group);
  sub->add_option("--mask-command", o->mask_command,
                  "Shell command that makes the mask of a picture, white where the object is, as a PNG file: {picture} "
                  "and {mask} stand for the files, else both are appended")
      ->type_name("COMMAND")
      ->group("Masks");
  sub->add_flag("--mask-features", o->mask_features,
                "Use only what the masks show, for an object on a turntable, whose background does not turn with it")
      ->group("Masks");
  add_common(*sub, o->common, {.device = false, .profile = false, .outside = false});
  sub->footer(
      "Examples:\n"
      "  vsplat poses photos/ --output posed/ && vsplat fit posed/ --output scene.ply && vsplat view scene.ply\n"
      "  vsplat poses video.mp4 --output posed/ --frames 80\n"
      "  vsplat poses photos/ --output posed/ --mask-command 'rembg i -om'\n"
      "COLMAP and, for videos, ffmpeg must be installed. The command works in DIR.unfinished; interrupted, it goes on\n"
      "from there when it is run again.");
  sub->callback([o, &run] { run = [o] { find_poses(*o); }; });
}

}  // namespace command
