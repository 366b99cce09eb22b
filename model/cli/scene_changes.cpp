#include "scene_changes.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "arguments.h"

namespace command {
namespace {

// "1,2,3,4" as `count` numbers.
std::vector<double> numbers(const std::string& option, const std::string& text, std::size_t count, const char* what) {
  std::vector<double> out;
  for (const std::string& part : list(option, text)) out.push_back(number(option, part));
  if (out.size() != count)
    throw UsageError(option + " is \"" + text + "\": " + std::to_string(count) + " numbers expected, " + what);
  return out;
}

std::uint64_t count_of(const std::string& option, const std::string& text) {
  const double value = number(option, text);
  if (value != std::floor(value) || value < 1 || value > INT32_MAX)
    throw UsageError(option + " is \"" + text + "\": a whole number from 1 to 2147483647 expected");
  return static_cast<std::uint64_t>(value);
}

void read_box(const std::string& text, vsplat_scene_edit_options& o) {
  if (text.empty()) return;
  const std::vector<double> v = numbers("--crop-box", text, 6, "the low corner's x,y,z and the high corner's");
  o.has_box = 1;
  for (std::size_t c = 0; c < 3; ++c) {
    o.box_low[c] = v[c];
    o.box_high[c] = v[3 + c];
    if (v[c] > v[3 + c])
      throw UsageError("--crop-box is \"" + text +
                       "\": give the low corner first: none of its coordinates may exceed the high corner's");
  }
}

void read_sphere(const std::string& text, vsplat_scene_edit_options& o) {
  if (text.empty()) return;
  const std::vector<double> v = numbers("--crop-sphere", text, 4, "the centre's x,y,z and the radius");
  if (!(v[3] > 0)) throw UsageError("--crop-sphere is \"" + text + "\": a radius above 0 expected");
  std::copy_n(v.begin(), 3, o.sphere_centre);
  o.sphere_radius = v[3];
}

// The letters in upper case, if they name axes.
std::string axes_letters(const std::string& option, const std::string& text) {
  if (text.empty()) return "";
  std::string out = text;
  int seen[3] = {};  // of each pair
  for (char& c : out) {
    c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    const std::size_t at = std::string("RLUDFB").find(c);
    if (at != std::string::npos) ++seen[at / 2];
  }
  if (out.size() != 3 || std::any_of(seen, seen + 3, [](int n) { return n != 1; }))
    throw UsageError(option + " is \"" + text +
                     "\": three letters expected that say where +x, +y and +z point, one of R and L, one of U and D "
                     "and one of F and B, such as RDF");
  return out;
}

}  // namespace

void add_change_options(CLI::App& app, ChangeOptions& o) {
  const OptionGroup removing(app, "Removing Gaussians, in the input's coordinates and units");
  app.add_option("--crop-box", o.box,
                 "Keep only Gaussians whose centres lie in this box, given by its low and its high corner")
      ->type_name("x,y,z,x,y,z");
  app.add_option("--crop-sphere", o.sphere,
                 "Keep only Gaussians whose centres lie in this sphere, given by its centre and radius")
      ->type_name("x,y,z,r");
  app.add_option("--min-opacity", o.min_opacity, "Remove Gaussians with an opacity below this, 0 to 1")->type_name("P");
  app.add_option("--max-size", o.max_size, "Remove Gaussians whose largest standard deviation is above this")
      ->type_name("S");
  app.add_flag("--remove-floaters", o.remove_floaters,
               "Remove isolated Gaussians: the mean distance to their eight nearest neighbours is more than ten times "
               "the scene's median, and more than three times their own size");
  const OptionGroup changing(app, "Changing the scene afterwards, in this order");
  app.add_option("--up", o.up, "The up direction in the input (default: the file's, else that of --from)")
      ->type_name("x,y,z");
  app.add_flag("--upright", o.upright,
               "Rotate the scene by the smallest angle that turns its up direction into that of the axes (--from)");
  app.add_option(
         "--from", o.from,
         "The input's axes: three letters for where +x, +y and +z point, each R or L (right, left), U or D (up, down), "
         "F or B (forward, back) (default: RDF, as in 3DGS and COLMAP)")
      ->type_name("XYZ");
  app.add_option(
         "--to", o.to,
         "The output's axes (default: the input's); positions, rotations and view-dependent colours are converted")
      ->type_name("XYZ");
  app.add_option("--scale", o.scale, "Scale about the origin")->type_name("S");
  app.add_option("--translate", o.translate, "Translate, after scaling")->type_name("x,y,z");
  app.add_option("--sh", o.sh, "Highest degree of spherical harmonics to keep")
      ->check(one_of({"0", "1", "2", "3", "4"}))
      ->type_name("0..4");
  app.add_option("--max-gaussians", o.max_gaussians,
                 "Keep only the N most visible Gaussians, those with the largest sums of blending weights in pictures "
                 "from 24 cameras around the scene")
      ->type_name("N");
}

SceneChanges::SceneChanges(const ChangeOptions& o)
    : from_(axes_letters("--from", o.from)), to_(axes_letters("--to", o.to)) {
  read_box(o.box, options_);
  read_sphere(o.sphere, options_);
  if (!o.min_opacity.empty()) {
    options_.min_opacity = number("--min-opacity", o.min_opacity);
    if (options_.min_opacity < 0 || options_.min_opacity > 1)
      throw UsageError("--min-opacity is \"" + o.min_opacity + "\": 0 to 1 expected");
  }
  if (!o.max_size.empty()) options_.max_size = positive_number("--max-size", o.max_size, "standard deviation");
  options_.remove_floaters = o.remove_floaters;
  if (!o.max_gaussians.empty()) max_gaussians_ = count_of("--max-gaussians", o.max_gaussians);
  if (!o.up.empty()) {
    const std::array<double, 3> up = triple("--up", o.up);
    std::copy(up.begin(), up.end(), options_.up);
    if (!is_set(options_.up)) throw UsageError("--up is \"" + o.up + "\": a direction expected, not all 0");
    has_up_ = true;
  }
  options_.upright = o.upright;
  if (!o.scale.empty()) options_.scale = positive_number("--scale", o.scale, "factor");
  if (!o.translate.empty()) {
    const std::array<double, 3> by = triple("--translate", o.translate);
    std::copy(by.begin(), by.end(), options_.translation);
  }
  if (!o.sh.empty()) options_.sh_degree = std::stoi(o.sh);  // already checked by CLI11
}

void SceneChanges::apply(const Common& common, vsplat::Scene& scene) {
  const vsplat_scene_info before = scene.info();
  vsplat_scene_edit_options o = options_;
  if (!from_.empty()) o.from_axes = from_.c_str();
  if (!to_.empty()) o.to_axes = to_.c_str();
  o.sh_degree = -1;
  const bool has_up = has_up_ || !from_.empty() || is_set(before.up);
  if (o.upright && !has_up) throw UsageError("--upright: the scene does not say which direction is up: give --up");
  result_ = vsplat::edit(scene, o);
  const auto tell = [&](uint64_t count, const std::string& what) {
    if (count > 0) say(common, std::to_string(count) + " of " + std::to_string(before.count) + " Gaussians " + what);
  };
  tell(result_.outside_box, "lie outside the box");
  tell(result_.outside_sphere, "lie outside the sphere");
  tell(result_.below_opacity, "are too transparent");
  tell(result_.above_size, "are too large");
  tell(result_.floaters, "are floaters");
  if (result_.mirrored)
    say(common,
        "The new axes have the other handedness, so the scene is mirrored: only programs with these axes show it "
        "correctly");
  if (before.count > 0 && result_.count == 0) warn("no Gaussian is left");
}

bool SceneChanges::reduces_sh(const vsplat::Scene& scene) const {
  return options_.sh_degree >= 0 && options_.sh_degree < scene.info().sh_degree;
}

void SceneChanges::reduce_sh(vsplat::Scene& scene) const {
  vsplat_scene_edit_options o = VSPLAT_SCENE_EDIT_OPTIONS_INIT;
  o.sh_degree = options_.sh_degree;
  vsplat::edit(scene, o);
}

void SceneChanges::add_results(nlohmann::ordered_json& out) const {
  out["removed"] = {{"outside_box", result_.outside_box},
                    {"outside_sphere", result_.outside_sphere},
                    {"below_opacity", result_.below_opacity},
                    {"above_size", result_.above_size},
                    {"floaters", result_.floaters}};
  out["mirrored"] = result_.mirrored != 0;
}

}  // namespace command
