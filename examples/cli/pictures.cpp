#include "pictures.h"

#include <cstdio>
#include <filesystem>

namespace command {

void add_picture_options(CLI::App& app, PictureOptions& o, const char* cameras_option) {
  const std::string group = "Pictures";
  app.add_option(
         cameras_option, o.cameras,
         "Draw the scene from these cameras (transforms.json, cameras.json, COLMAP model or a folder with one), "
         "or from N on a circle")
      ->type_name("CAMERAS|orbit:N")
      ->group(group);
  app.add_option("--images", o.images, "Folder for the pictures: 0000.png, ... in the cameras' order")
      ->type_name("DIR")
      ->group(group);
  app.add_option("--size", o.size, "Size of the pictures; intrinsics are scaled along")->type_name("WxH")->group(group);
  app.add_option("--background", o.background, "Colour behind the scene, each 0 to 1 (default 1,1,1)")
      ->type_name("r,g,b")
      ->group(group);
  app.add_option("--format", o.format, "8-bit PNG, or EXR with alpha and depth")
      ->check(one_of({"png", "exr"}))
      ->type_name("png|exr")
      ->group(group);
  app.add_flag("--exr-raw", o.exr_raw, "EXR as rasterised: float, over the background, no curve, depth accumulated")
      ->group(group);
  app.add_option("--orbit-radius", o.orbit_radius, "Distance of orbit:N's cameras, world units")
      ->type_name("R")
      ->group(group);
  app.add_option("--orbit-elevation", o.orbit_elevation, "Their elevation, degrees")->type_name("DEG")->group(group);
  app.add_option("--up", o.up, "Which way is up in the world")->type_name("x,y,z")->group(group);
}

PictureJob::PictureJob(const PictureOptions& o) : cameras(o.cameras), images(o.images) {
  wanted = !o.cameras.empty();
  if (wanted) orbit = orbit_count("orbit", o.cameras);
  if (!o.size.empty()) size = picture_size("--size", o.size);
  if (!o.background.empty()) {
    background = triple("--background", o.background);
    for (const double v : background)
      if (v < 0 || v > 1) throw UsageError("--background is \"" + o.background + "\": each of r,g,b goes from 0 to 1");
  }
  if (!o.near.empty()) near = positive_number("--near", o.near, "distance in world units");
  if (o.exr_raw && o.format != "exr") throw UsageError("--exr-raw needs --format exr");
  format = o.format == "png" ? VSPLAT_PICTURE_PNG : o.exr_raw ? VSPLAT_PICTURE_EXR_RAW : VSPLAT_PICTURE_EXR;
  orbit_options.count = orbit.value_or(0);
  if (size) orbit_options.width = size->width, orbit_options.height = size->height;
  if (!o.orbit_radius.empty())
    orbit_options.radius = positive_number("--orbit-radius", o.orbit_radius, "distance in world units");
  if (!o.orbit_elevation.empty()) {
    orbit_options.has_elevation = 1;
    orbit_options.elevation = number("--orbit-elevation", o.orbit_elevation);
    if (orbit_options.elevation <= -90 || orbit_options.elevation >= 90)
      throw UsageError("--orbit-elevation is \"" + o.orbit_elevation + "\": degrees between -90 and 90 expected");
  }
  if (!o.up.empty()) {
    const std::array<double, 3> up = triple("--up", o.up);
    if (up[0] == 0 && up[1] == 0 && up[2] == 0) throw UsageError("--up is \"" + o.up + "\": not a direction");
    orbit_options.has_up = 1;
    for (int i = 0; i < 3; ++i) orbit_options.up[i] = up[static_cast<std::size_t>(i)];
  }
}

std::vector<vsplat_camera> PictureJob::load_cameras(int fallback) const {
  const Size unknown = size.value_or(Size{fallback, fallback});
  std::vector<vsplat_camera> all = vsplat::Cameras::load(cameras, unknown.width, unknown.height).all();
  if (!size) return all;
  for (vsplat_camera& c : all) {
    const double x = static_cast<double>(size->width) / c.width, y = static_cast<double>(size->height) / c.height;
    c.fx *= x, c.cx *= x, c.fy *= y, c.cy *= y;
    c.width = size->width, c.height = size->height;
  }
  return all;
}

std::string PictureJob::file(std::size_t index) const {
  char name[32];
  std::snprintf(name, sizeof name, "%04zu.%s", index, format == VSPLAT_PICTURE_PNG ? "png" : "exr");
  return (std::filesystem::path(images) / name).string();
}

void PictureJob::expect(Outputs& outputs, std::size_t count) const {
  for (std::size_t i = 0; i < count; ++i) outputs.expect(file(i));
}

void PictureJob::draw(Session& session, const vsplat::Scene& scene, const std::vector<vsplat_camera>& all,
                      Outputs& outputs) const {
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  options.near_plane = near;
  // A linear, premultiplied EXR holds no background: what is drawn over black is just that.
  for (std::size_t i = 0; i < 3; ++i)
    options.background[i] = format == VSPLAT_PICTURE_EXR ? 0.0f : static_cast<float>(background[i]);
  session.start("drawing");
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!Session::on_progress(&session, "splat", static_cast<double>(i) / static_cast<double>(all.size())))
      throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
    vsplat::render(session.device(), scene, all[i], options).save(outputs.begin(file(i)), format);
  }
}

}  // namespace command
