// vsplat: the command line. Each sub-command has a file of its own; this one combines them.
#include <vsplat/vsplat.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "carry_out.h"
#include "command.h"
#include "help_format.h"

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + std::min(argc, 1), argv + argc);
  CLI::App app("Turns posed photos into a 3D Gaussian splat, and draws it from anywhere, on any OpenCL device.",
               "vsplat");
  app.set_version_flag("-V,--version", std::string("vsplat ") + vsplat_version_string());
  app.require_subcommand(1);
  app.formatter(std::make_shared<command::HelpFormat>());
  app.footer(
      "Examples:\n"
      "  vsplat devices                                   lists what vsplat can compute on\n"
      "  vsplat doctor                                    says why there is no device, and what to do\n"
      "  vsplat poses photos/ --output posed/             finds the cameras of bare photographs, with COLMAP\n"
      "  vsplat reconstruct photos/ --output scene.ply --render orbit:72 --turntable turn.webp\n"
      "  vsplat fit photos/ --start scene.ply --output sharp.ply\n"
      "  vsplat render scene.ply --cameras orbit:24 --images turn/ --size 640x480\n"
      "  vsplat view scene.ply                            shows it in the browser\n"
      "  vsplat mesh scene.ply --output scene.glb         writes its surface as triangles\n"
      "  vsplat-window scene.ply                          shows it, turned with the mouse (where SDL is installed)\n"
      "`vsplat help COMMAND` and `vsplat COMMAND --help` show all options of a command, with examples.");
  command::Run run;
  command::add_poses(app, run);
  command::add_reconstruct(app, run);
  command::add_fit(app, run);
  command::add_render(app, run);
  command::add_view(app, run);
  command::add_scene_convert(app, run);
  command::add_scene_info(app, run);
  command::add_mesh(app, run);
  command::add_init(app, run);
  command::add_weights(app, run);
  command::add_devices(app, run);
  command::add_doctor(app, run);
  command::add_report(app, run);
  command::add_kernels(app, run);
  command::add_tune(app, run);
  command::add_selftest(app, run);
  command::add_bench(app, run, arguments);
  command::add_profile(app, run);
  command::add_dataset(app, run);
  command::add_train(app, run);
  command::add_evaluate(app, run);
  command::add_help(app, run);
  command::add_completion(app, run);
  return command::carry_out(app, run, arguments);
}
