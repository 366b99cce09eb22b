// vsplat mesh: the surface of a scene as triangles.
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "arguments.h"
#include "naming.h"
#include "scene_file.h"
#include "session.h"

namespace command {
namespace {

struct MeshOptions {
  Common common;
  std::string scene, output, cameras, center, scale, depth;
  std::string voxels, max_triangles, min_part;
  bool skip_bad = false;
};

// A whole number from `least` to `most`, or `otherwise` if the option was not given.
uint64_t whole(const std::string& option, const std::string& text, double least, double most, uint64_t otherwise) {
  if (text.empty()) return otherwise;
  const double value = number(option, text);
  if (!(value >= least && value <= most) || value != static_cast<double>(static_cast<uint64_t>(value)))
    throw UsageError(option + " is \"" + text + "\": a whole number " +
                     (most < 1e9 ? "from " + std::to_string(static_cast<uint64_t>(least)) + " to " +
                                       std::to_string(static_cast<uint64_t>(most))
                                 : "of 0 or more") +
                     " expected");
  return static_cast<uint64_t>(value);
}

vsplat_scene_mesh_options options_of(const MeshOptions& o) {
  constexpr uint64_t usual_triangles = 200000;
  constexpr double fewest_voxels = 16, most_voxels = 2048, most_triangles = 4e9;
  vsplat_scene_mesh_options out = VSPLAT_SCENE_MESH_OPTIONS_INIT;
  out.voxels =
      static_cast<int32_t>(whole("--voxels", o.voxels, fewest_voxels, most_voxels, static_cast<uint64_t>(out.voxels)));
  out.max_triangles = whole("--max-triangles", o.max_triangles, 0, most_triangles, usual_triangles);
  if (!o.min_part.empty()) out.least_part = percentage("--min-part", o.min_part);
  if (out.least_part > 1) throw UsageError("--min-part is \"" + o.min_part + "\": at most 100% expected");
  if (o.center.empty() != o.scale.empty())
    throw UsageError("--center and --scale are given together: the cube's centre and its edge");
  if (!o.center.empty()) {
    const std::array<double, 3> center = triple("--center", o.center);
    std::copy(center.begin(), center.end(), out.center);
    out.has_center = 1;
    out.scale = positive_number("--scale", o.scale, "edge length in world units");
  }
  if (o.depth == "expected") out.depth = VSPLAT_SURFACE_EXPECTED;
  return out;
}

std::vector<vsplat_camera> cameras_of(const MeshOptions& o) {
  constexpr int32_t unknown = 512;  // pixels, for lists without sizes
  if (o.cameras.empty()) return {};
  vsplat_cameras_options read = VSPLAT_CAMERAS_OPTIONS_INIT;
  read.width = read.height = unknown;
  read.skip_bad = o.skip_bad;
  return vsplat::Cameras::load(o.cameras, read).all();
}

void mesh(const MeshOptions& o) {
  vsplat_scene_mesh_options options = options_of(o);
  const std::string ending = lower_case(std::filesystem::path(o.output).extension());
  if (ending != ".glb" && ending != ".ply")
    throw UsageError("--output is \"" + o.output + "\": a name that ends in .glb or .ply expected");
  set_up_library(o.common);
  Outputs outputs(o.common.overwrite);
  outputs.input(o.scene);
  outputs.input_cameras(o.cameras);
  for (const std::string& path : {o.output, o.common.profile, o.common.trace}) outputs.expect(path);
  const std::vector<vsplat_camera> cameras = cameras_of(o);
  const vsplat::Scene scene = load_scene(o.scene, o.skip_bad);
  options.cameras = cameras.empty() ? nullptr : cameras.data();
  options.num_cameras = cameras.size();
  Session session(o.common);
  session.about("command", "mesh");
  session.about("scene", o.scene);
  session.start("meshing");
  options.progress = &Session::on_progress;
  options.user = &session;
  const vsplat::Mesh made =
      naming({o.scene}, {}, [&] { return vsplat::mesh_from_scene(session.device(), scene, options); });
  clear_progress();
  vsplat::save(made, outputs.begin(o.output));
  session.write_profile(outputs);
  outputs.commit();
  const vsplat_mesh_info info = made.info();
  say(o.common, o.output + ": " + std::to_string(info.triangles) + " triangles, " + std::to_string(info.vertices) +
                    " vertices, " + seconds_text(elapsed_seconds()));
  if (!o.common.json) return;
  nlohmann::ordered_json out = {{"output", o.output}, {"triangles", info.triangles}, {"vertices", info.vertices}};
  session.add_numerics(out);
  out["seconds"] = elapsed_seconds();
  print_json(out);
}

}  // namespace

void add_mesh(CLI::App& app, Run& run) {
  auto o = std::make_shared<MeshOptions>();
  CLI::App* sub = app.add_subcommand("mesh", "Write the surface of a scene as a triangle mesh");
  sub->add_option("scene", o->scene, "A scene file in any supported format")->required()->type_name("SCENE");
  sub->add_option("-o,--output", o->output,
                  "The mesh to write: GLB in glTF's axes (the scene's -y is up), or PLY in the scene's world")
      ->required()
      ->type_name("FILE.glb|.ply");
  sub->add_option("--cameras", o->cameras,
                  "Cameras that see the surface, those of the fit for a place (transforms.json, cameras.json, a COLMAP "
                  "model or a folder with one; default: 48 all around the scene, for an object)")
      ->type_name("CAMERAS");
  sub->add_option("--voxels", o->voxels,
                  "Resolution along the longest edge of the box around the surface, 16 to 2048 (default: 256)")
      ->type_name("N");
  sub->add_option("--max-triangles", o->max_triangles,
                  "Most triangles: more are merged where the surface changes least (default: 200000; 0: all)")
      ->type_name("N");
  sub->add_option("--min-part", o->min_part,
                  "Leave out separate parts with less than this share of the largest part's area (default: 1%)")
      ->type_name("PERCENT");
  sub->add_option("--center", o->center,
                  "Centre of the cube to mesh, world coordinates; needs --scale (default: the box of what is seen)")
      ->type_name("x,y,z");
  sub->add_option("--scale", o->scale, "Edge of the cube to mesh, world units; needs --center")->type_name("S");
  sub->add_option("--depth", o->depth,
                  "Depth of a pixel's surface: where half of the light is absorbed (default), or the mean, which is "
                  "faster")
      ->check(one_of({"median", "expected"}))
      ->type_name("median|expected");
  sub->add_flag("--skip-bad", o->skip_bad,
                "Leave out and count Gaussians that cannot be drawn, and cameras that cannot be used");
  add_common(*sub, o->common);
  sub->footer(
      "Depths and colours are drawn from the cameras and fused in a distance field. Colours are at the vertices, so\n"
      "more triangles show finer colours. What no camera sees stays open.\n"
      "Examples:\n"
      "  vsplat mesh scene.ply --output scene.glb\n"
      "  vsplat mesh scene.ply --output fine.ply --voxels 512 --max-triangles 1000000\n"
      "  vsplat mesh room.ply --output room.glb --cameras photos/\n"
      "  vsplat mesh room.ply --output chair.glb --cameras photos/ --center 0.2,1,0.5 --scale 1.5");
  sub->callback([o, &run] { run = [o] { mesh(*o); }; });
}

}  // namespace command
