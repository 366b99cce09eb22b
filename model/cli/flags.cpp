#include "flags.h"

#include <vsplat/dataset.h>
#include <vsplat/evaluate.h>
#include <vsplat/fit.h>
#include <vsplat/train.h>
#include <vsplat/tune.h>

#include <vector>
#include <vsplat/vsplat.hpp>

namespace command {
namespace {

struct Flag {
  const char *field, *flag;
};

// A field or function that the library does not have fails to compile.
template <auto>
constexpr Flag flag(const char* field, const char* flag) {
  return {field, flag};
}
#define FIELD(options, field, text) flag<&options::field>(#options "." #field, text)
#define FUNCTION(name, text) flag<&name>(#name, text)

constexpr Flag flags[] = {
    FIELD(vsplat_device_options, device, "--device"),
    FIELD(vsplat_device_options, gemm, "--gemm"),
    FIELD(vsplat_device_options, kernels, "--kernels"),
    FIELD(vsplat_device_options, max_memory_gib, "--max-memory"),
    FIELD(vsplat_device_options, precision, "--precision"),
    FIELD(vsplat_evaluate_options, more_devices, "--device"),
    FIELD(vsplat_evaluate_options, picture_size, "--size"),
    FIELD(vsplat_evaluate_options, pose_draws, "--pose-draws"),
    FIELD(vsplat_evaluate_options, pose_noise, "--pose-noise"),
    FIELD(vsplat_evaluate_options, refine, "--refine"),
    FIELD(vsplat_evaluate_options, supersample, "--supersample"),
    FIELD(vsplat_evaluate_options, view_count, "--view-count"),
    FIELD(vsplat_file_rules, allow_outside, "--allow-outside"),
    FIELD(vsplat_import_options, config_file, "--config"),
    FIELD(vsplat_import_options, fields, "--set"),
    FIELD(vsplat_input_options, auto_frame, "--auto-frame"),
    FIELD(vsplat_input_options, center, "--center"),
    FIELD(vsplat_input_options, force, "--force"),
    FIELD(vsplat_input_options, names, "--views"),
    FIELD(vsplat_input_options, scale, "--scale"),
    FIELD(vsplat_input_options, view_count, "--view-count"),
    FIELD(vsplat_model_options, fields, "--set"),
    FIELD(vsplat_orbit_options, elevation, "--orbit-elevation"),
    FIELD(vsplat_orbit_options, radius, "--orbit-radius"),
    FIELD(vsplat_orbit_options, up, "--up"),
    FIELD(vsplat_reconstruct_options, assume_selected, "--assume-selected"),
    FIELD(vsplat_reconstruct_options, fit_epochs, "--fit-epochs"),
    FIELD(vsplat_reconstruct_options, merge_cell, "--merge-cell"),
    FIELD(vsplat_reconstruct_options, passes, "--passes"),
    FIELD(vsplat_reconstruct_options, seed, "--selection-seed"),
    FIELD(vsplat_reconstruct_options, selection, "--selection"),
    FIELD(vsplat_fit_options, background, "--background"),
    FIELD(vsplat_fit_options, checkpoint, "--checkpoint"),
    FIELD(vsplat_fit_options, depth, "--depth"),
    FIELD(vsplat_fit_options, extent, "--scene"),
    FIELD(vsplat_fit_options, freeze, "--freeze"),
    FIELD(vsplat_fit_options, holdout_count, "--holdout"),
    FIELD(vsplat_fit_options, holdout_names, "--holdout"),
    FIELD(vsplat_fit_options, invert_masks, "--invert-masks"),
    FIELD(vsplat_fit_options, longest, "--size"),
    FIELD(vsplat_fit_options, masks, "--masks"),
    FIELD(vsplat_fit_options, max_gaussians, "--max-gaussians"),
    FIELD(vsplat_fit_options, names, "--views"),
    FIELD(vsplat_fit_options, near_plane, "--near"),
    FIELD(vsplat_fit_options, resume, "--resume"),
    FIELD(vsplat_render_options, antialias, "--antialias"),
    FIELD(vsplat_render_options, supersample, "--supersample"),
    FIELD(vsplat_scene_load_options, skip_bad, "--skip-bad"),
    FIELD(vsplat_train_options, assume_selected, "--assume-selected"),
    FIELD(vsplat_train_options, data, "--data"),
    FIELD(vsplat_train_options, extend, "--extend"),
    FIELD(vsplat_train_options, more_devices, "--device"),
    FIELD(vsplat_train_options, resume, "--resume"),
    FIELD(vsplat_train_options, textures, "--textures"),
    FIELD(vsplat_tune_options, path, "--output"),
    FIELD(vsplat_views_options, skip_bad, "--skip-bad"),
    FUNCTION(vsplat_doctor, "`vsplat doctor`"),
    FUNCTION(vsplat_mesh_load, "--texture"),
    FUNCTION(vsplat_model_init, "`vsplat init`"),
    FUNCTION(vsplat_model_load, "--model"),
    FUNCTION(vsplat_scene_surfels_to_gaussians, "`vsplat convert --surfels-to-gaussians`"),
    FUNCTION(vsplat_selftest, "`vsplat selftest`"),
    FUNCTION(vsplat_set_host_memory, "--max-host-memory"),
    FUNCTION(vsplat_train, "`vsplat train`"),
    FUNCTION(vsplat_train_plan, "--dry-run"),
    FUNCTION(vsplat_tune, "`vsplat tune`"),
    FUNCTION(vsplat_views_load, "--pictures"),
};
#undef FIELD
#undef FUNCTION

}  // namespace

void name_options() {
  std::vector<const char*> fields, names;
  for (const Flag& each : flags) fields.push_back(each.field), names.push_back(each.flag);
  vsplat::check(vsplat_option_names_set(fields.data(), names.data(), fields.size()));
}

}  // namespace command
