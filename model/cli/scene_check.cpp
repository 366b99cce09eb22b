#include "scene_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <vector>

namespace command {
namespace {

constexpr int kPictures = 8, kSide = 512;

// Infinite for 0.
double psnr_of(double mean_square) { return -10 * std::log10(mean_square); }

std::string psnr_text(double value) {
  if (std::isinf(value)) return "identical pictures";
  char out[32];
  std::snprintf(out, sizeof out, "%.2f dB", value);
  return out;
}

nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json();
}

// The mean square of the differences; 0 for equal pictures.
double error_between(const vsplat::Picture& a, const vsplat::Picture& b) {
  return std::pow(10.0, -vsplat::compare(a.colour, b.colour, kSide, kSide).psnr / 10);
}

}  // namespace

SceneCheck::SceneCheck(Session& session, const vsplat::Scene& original, const vsplat::Scene& scene,
                       const vsplat::Scene& written) {
  const vsplat_scene_info before = scene.info(), after = written.info();
  if (before.count == after.count && before.surfels == after.surfels) difference_ = vsplat::difference(scene, written);
  vsplat_orbit_options orbit = VSPLAT_ORBIT_OPTIONS_INIT;
  orbit.count = kPictures;
  orbit.width = orbit.height = kSide;
  const std::vector<vsplat_camera> cameras = original.orbit(orbit).all();
  // All of one scene, then all of the other: each is placed on the device once.
  std::vector<vsplat::Picture> drawn;
  session.start("verifying");
  for (const vsplat::Scene* one : {&original, &written})
    for (const vsplat_camera& camera : cameras) {
      const double done = static_cast<double>(drawn.size()) / (2.0 * kPictures);
      if (!Session::on_progress(&session, "drawing", done)) throw vsplat::Error(VSPLAT_ERROR_CANCELLED, "stopped");
      drawn.push_back(vsplat::render(session.device(), *one, camera));
    }
  clear_progress();
  pictures_ = cameras.size();
  double all = 0, most = 0;
  for (std::size_t i = 0; i < pictures_; ++i) {
    const double error = error_between(drawn[i], drawn[pictures_ + i]);
    all += error;
    most = std::max(most, error);
  }
  psnr_ = psnr_of(all / static_cast<double>(pictures_));
  worst_ = psnr_of(most);
}

std::string SceneCheck::text() const {
  std::string out = "PSNR over pictures from " + std::to_string(pictures_) + " cameras: " + psnr_text(psnr_);
  if (std::isfinite(psnr_)) out += ", the lowest " + psnr_text(worst_);
  if (!difference_) return out;
  const vsplat_scene_difference& d = *difference_;
  char table[640];
  std::snprintf(table, sizeof table,
                "\n  %-10s %12s %12s\n  %-10s %12.3g %12.3g  world units\n  %-10s %12.3g %12.3g  world units\n"
                "  %-10s %12.3g %12.3g  degrees\n  %-10s %12.3g %12.3g\n  %-10s %12.3g %12.3g",
                "difference", "largest", "RMS", "positions", d.means, d.means_rms, "sizes", d.scales, d.scales_rms,
                "rotations", d.rotations, d.rotations_rms, "opacities", d.opacities, d.opacities_rms, "SH", d.sh,
                d.sh_rms);
  return out + table;
}

void SceneCheck::add_results(double limit, nlohmann::ordered_json& out) const {
  nlohmann::ordered_json& to = out["verification"];
  to = {{"pictures", pictures_}, {"psnr", number_or_null(psnr_)}, {"worst", number_or_null(worst_)}, {"limit", limit}};
  if (!difference_) return;
  const vsplat_scene_difference& d = *difference_;
  const auto row = [](double largest, double rms) {
    return nlohmann::ordered_json{{"largest", largest}, {"rms", rms}};
  };
  to["in_order"] = d.in_order != 0;
  to["difference"] = {{"positions", row(d.means, d.means_rms)},
                      {"sizes", row(d.scales, d.scales_rms)},
                      {"rotations", row(d.rotations, d.rotations_rms)},
                      {"opacities", row(d.opacities, d.opacities_rms)},
                      {"sh", row(d.sh, d.sh_rms)}};
}

}  // namespace command
