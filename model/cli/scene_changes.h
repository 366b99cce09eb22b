// The options of `vsplat convert` that change a scene.
#pragma once
#include <CLI/CLI.hpp>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {

struct ChangeOptions {
  std::string box, sphere, min_opacity, max_size, max_gaussians, up, from, to, scale, translate, sh;
  bool remove_floaters = false, upright = false;
};
void add_change_options(CLI::App& app, ChangeOptions& options);

// Parsed options; the constructor reports every error of the request itself.
class SceneChanges {
 public:
  explicit SceneChanges(const ChangeOptions& options);

  // How many Gaussians are kept, the most visible ones; 0: all. This needs a device.
  std::uint64_t max_gaussians() const { return max_gaussians_; }
  // Applies all but what reduces the scene, and says what was removed.
  void apply(const Common& common, vsplat::Scene& scene);
  // Whether spherical harmonics of the scene are left out, which reduce_sh() does.
  bool reduces_sh(const vsplat::Scene& scene) const;
  void reduce_sh(vsplat::Scene& scene) const;
  // Adds "removed" and "mirrored" of what apply() did.
  void add_results(nlohmann::ordered_json& out) const;

 private:
  std::string from_, to_;
  bool has_up_ = false;
  std::uint64_t max_gaussians_ = 0;
  vsplat_scene_edit_options options_ = VSPLAT_SCENE_EDIT_OPTIONS_INIT;
  vsplat_scene_edit_result result_ = VSPLAT_SCENE_EDIT_RESULT_INIT;
};

}  // namespace command
