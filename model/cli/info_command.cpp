// vsplat info: what a scene file holds.
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "arguments.h"
#include "outputs.h"
#include "scene_file.h"
#include "session.h"

namespace command {
namespace {

using nlohmann::ordered_json;

constexpr int kPictureSide = 384;            // of the picture
constexpr int kWidth = 1280, kHeight = 720;  // the picture whose memory is shown

struct InfoOptions {
  Common common;
  std::string scene, picture;
};

struct Found {
  vsplat_scene_file file;
  vsplat_scene_info scene;
  vsplat_scene_statistics numbers;
  std::optional<uint64_t> drawing;  // bytes of device memory; nothing without a device

  uint64_t skipped() const { return scene.skipped_not_finite + scene.skipped_huge_scale + scene.skipped_zero_rotation; }
  uint64_t all() const { return numbers.count + skipped(); }  // Gaussians of the file
  double share(uint64_t count) const {
    return all() == 0 ? 0 : static_cast<double>(count) / static_cast<double>(all());
  }
};

ordered_json three(const double (&v)[3]) { return {v[0], v[1], v[2]}; }

ordered_json json_of(const InfoOptions& o, const Found& f) {
  const vsplat_scene_statistics& n = f.numbers;
  ordered_json out = {{"scene", o.scene},
                      {"format", f.file.format},
                      {"version", *f.file.version ? ordered_json(f.file.version) : ordered_json()},
                      {"bytes", f.file.bytes},
                      {"gaussians", n.count},
                      {"kind", f.scene.surfels ? "surfels" : "volumes"},
                      {"sh_degree", f.scene.sh_degree},
                      {"antialias", f.scene.antialias != 0},
                      {"near", f.scene.near_plane},
                      {"axes", *f.file.axes ? ordered_json(f.file.axes) : ordered_json()},
                      {"up", is_set(f.scene.up) ? three(f.scene.up) : ordered_json()},
                      {"offset", is_set(f.scene.offset) ? three(f.scene.offset) : ordered_json()},
                      {"mirror", f.scene.has_mirror ? three(f.scene.mirror) : ordered_json()},
                      {"detail_pixel", f.scene.detail_pixel > 0 ? ordered_json(f.scene.detail_pixel) : ordered_json()}};
  out["bounds"] = {
      {"low", three(n.low)}, {"high", three(n.high)}, {"low_1", three(n.low_1)}, {"high_99", three(n.high_99)}};
  out["shares"] = {{"bad", f.share(f.skipped() + n.not_finite)},
                   {"transparent", f.share(n.transparent)},
                   {"invisible", f.share(n.invisible)},
                   {"huge", f.share(n.huge)},
                   {"distant", f.share(n.distant)}};
  out["bad"] = {{"not_finite", f.scene.skipped_not_finite + n.not_finite},
                {"huge_scale", f.scene.skipped_huge_scale},
                {"zero_rotation", f.scene.skipped_zero_rotation}};
  out["median_opacity"] = n.median_opacity;
  out["median_size"] = n.median_size;
  out["largest_size"] = n.largest_size;
  out["memory"] = {{"gaussians", n.bytes}, {"drawing", f.drawing ? ordered_json(*f.drawing) : ordered_json()}};
  if (!o.picture.empty()) out["picture"] = o.picture;
  return out;
}

std::string three_text(const double (&v)[3]) {
  char out[96];
  std::snprintf(out, sizeof out, "%11.5g %11.5g %11.5g", v[0], v[1], v[2]);
  return out;
}

void print_row(const char* name, const std::string& value) {
  std::printf("%-14s %s\n", name, for_terminal(value).c_str());
}

void print_share(const Found& f, const char* name, uint64_t count, const char* what) {
  std::printf("%-14s %6.2f %%  %s\n", name, 100 * f.share(count), what);
}

void print_text(const InfoOptions& o, const Found& f) {
  const vsplat_scene_statistics& n = f.numbers;
  print_row("scene", o.scene);
  print_row("format", std::string(f.file.title) + (*f.file.version ? ", " + std::string(f.file.version) : "") + ", " +
                          bytes_text(f.file.bytes));
  print_row(f.scene.surfels ? "surfels" : "Gaussians", std::to_string(n.count));
  print_row("SH degree", std::to_string(f.scene.sh_degree));
  print_row("anti-aliasing", f.scene.antialias ? "yes" : "no");
  print_row("axes", *f.file.axes ? std::string(f.file.axes) + " in the file, converted to RDF when read"
                                 : "not defined by the format (RDF if 3DGS wrote it)");
  print_row("up", is_set(f.scene.up) ? three_text(f.scene.up) : "not in the file");
  if (is_set(f.scene.offset)) print_row("offset", three_text(f.scene.offset));
  print_row("bounds", three_text(n.low) + "  to");
  print_row("", three_text(n.high));
  print_row("1 % to 99 %", three_text(n.low_1) + "  to");
  print_row("", three_text(n.high_99));
  char sizes[96];
  std::snprintf(sizes, sizeof sizes, "median %.4g, largest %.4g (standard deviations)", n.median_size, n.largest_size);
  print_row("size", sizes);
  char opacity[32];
  std::snprintf(opacity, sizeof opacity, "median %.3f", n.median_opacity);
  print_row("opacity", opacity);
  print_share(f, "bad", f.skipped() + n.not_finite, "NaN, infinite, scale too large, or rotation of length 0");
  print_share(f, "transparent", n.transparent, "opacity below 0.1");
  print_share(f, "invisible", n.invisible, "opacity below 1/255");
  print_share(f, "huge", n.huge, "standard deviation above a tenth of the 1 % to 99 % box's diagonal");
  print_share(f, "distant", n.distant, "more than ten times as far from the middle as the median Gaussian");
  print_row("memory", bytes_text(n.bytes) + " for the Gaussians" +
                          (f.drawing ? ", about " + bytes_text(*f.drawing) + " on the device to draw " +
                                           std::to_string(kWidth) + " x " + std::to_string(kHeight) + " pixels"
                                     : ""));
}

void draw(const InfoOptions& o, const Session& session, const vsplat::Scene& scene, Outputs& outputs) {
  vsplat_orbit_options orbit = VSPLAT_ORBIT_OPTIONS_INIT;
  orbit.count = 1;
  orbit.width = orbit.height = kPictureSide;
  const vsplat::Picture picture = vsplat::render(session.device(), scene, scene.orbit(orbit).all().front());
  picture.save(outputs.begin(o.picture), VSPLAT_PICTURE_PNG);
}

// Without a device, only what needs one is missing, unless the user asked for one.
void use_device(const InfoOptions& o, const vsplat::Scene& scene, Found& found, Outputs& outputs) {
  std::optional<Session> session;
  try {
    session.emplace(o.common);
  } catch (const vsplat::Error& e) {
    if (!o.picture.empty() || !o.common.device.empty()) throw;
    say(o.common, std::string("the memory for drawing is unknown: ") + e.what());
    return;
  }
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  vsplat::check(vsplat_plan_render(session->device().get(), found.numbers.count, std::min(found.scene.sh_degree, 3),
                                   kWidth, kHeight, &plan));
  found.drawing = plan.peak;
  if (!o.picture.empty()) draw(o, *session, scene, outputs);
}

void info(const InfoOptions& o) {
  set_up_library(o.common);
  need_ending("--picture", o.picture, ".png");
  Outputs outputs(o.common.overwrite);
  outputs.input(o.scene);
  outputs.expect(o.picture);
  Found found{vsplat::describe_scene_file(o.scene), {}, {}, {}};
  const vsplat::Scene scene = load_scene(o.scene, true);  // bad Gaussians are counted
  found.scene = scene.info();
  found.numbers = vsplat::statistics(scene);
  use_device(o, scene, found, outputs);
  outputs.commit();
  if (o.common.json)
    print_json(json_of(o, found));
  else
    print_text(o, found);
}

}  // namespace

void add_scene_info(CLI::App& app, Run& run) {
  auto o = std::make_shared<InfoOptions>();
  CLI::App* sub =
      app.add_subcommand("info", "Show what a scene file holds: format, bounds, suspicious Gaussians, memory");
  sub->add_option("scene", o->scene, "A scene file in any supported format")->required()->type_name("SCENE");
  sub->add_option("--picture", o->picture, "Draw a small picture of the scene from the front")->type_name("FILE.png");
  add_common(*sub, o->common, {.profile = false, .outside = false});
  sub->footer(
      "Positions and sizes are in world units. Gaussians that cannot be drawn are counted as bad and left out of all\n"
      "other figures.\n"
      "Examples:\n"
      "  vsplat info scene.ply\n"
      "  vsplat info scene.spz --picture front.png --json");
  sub->callback([o, &run] { run = [o] { info(*o); }; });
}

}  // namespace command
