// What messages call the options of this interface: the fields and functions of C, until a program sets its own names.
#include <algorithm>

#include "model/api/handle.h"
#include "runtime/option.h"

using namespace vsplat;

namespace {

struct CName {
  Option option;
  const char* name;
};

// A name that the interface does not have fails to compile.
template <auto>
constexpr CName named(Option option, const char* name) {
  return {option, name};
}
#define FIELD(option, options, field) named<&options::field>(Option::option, #options "." #field)
#define FUNCTION(option, name) named<&name>(Option::option, #name)

constexpr CName c_names[] = {
    FIELD(allow_outside, vsplat_file_rules, allow_outside),
    FIELD(device, vsplat_device_options, device),
    FIELD(gemm, vsplat_device_options, gemm),
    FIELD(kernels, vsplat_device_options, kernels),
    FUNCTION(max_host_memory, vsplat_set_host_memory),
    FIELD(max_memory, vsplat_device_options, max_memory_gib),
    FIELD(precision, vsplat_device_options, precision),

    FIELD(auto_frame, vsplat_input_options, auto_frame),
    FIELD(center, vsplat_input_options, center),
    FIELD(force, vsplat_input_options, force),
    FUNCTION(pictures, vsplat_views_load),
    FIELD(scale, vsplat_input_options, scale),
    FIELD(skip_bad_views, vsplat_views_options, skip_bad),
    FIELD(view_count, vsplat_input_options, view_count),
    FIELD(views, vsplat_input_options, names),

    FIELD(assume_selected, vsplat_reconstruct_options, assume_selected),
    FIELD(fit_epochs, vsplat_reconstruct_options, fit_epochs),
    FIELD(merge_cell, vsplat_reconstruct_options, merge_cell),
    FIELD(passes, vsplat_reconstruct_options, passes),
    FIELD(selection, vsplat_reconstruct_options, selection),
    FIELD(selection_seed, vsplat_reconstruct_options, seed),

    FIELD(antialias, vsplat_render_options, antialias),
    FIELD(orbit_elevation, vsplat_orbit_options, elevation),
    FIELD(orbit_radius, vsplat_orbit_options, radius),
    FIELD(skip_bad_gaussians, vsplat_scene_load_options, skip_bad),
    FIELD(supersample, vsplat_render_options, supersample),
    FUNCTION(surfels_to_gaussians, vsplat_scene_surfels_to_gaussians),
    FIELD(up, vsplat_orbit_options, up),

    FIELD(background, vsplat_fit_options, background),
    FIELD(fit_checkpoint, vsplat_fit_options, checkpoint),
    FIELD(fit_depth, vsplat_fit_options, depth),
    FIELD(fit_extent, vsplat_fit_options, extent),
    FIELD(fit_resume, vsplat_fit_options, resume),
    FIELD(fit_views, vsplat_fit_options, names),
    FIELD(freeze, vsplat_fit_options, freeze),
    FIELD(holdout_count, vsplat_fit_options, holdout_count),
    FIELD(holdout_names, vsplat_fit_options, holdout_names),
    FIELD(invert_masks, vsplat_fit_options, invert_masks),
    FIELD(longest, vsplat_fit_options, longest),
    FIELD(masks, vsplat_fit_options, masks),
    FIELD(max_gaussians, vsplat_fit_options, max_gaussians),
    FIELD(near_plane, vsplat_fit_options, near_plane),

    FIELD(import_config, vsplat_import_options, config_file),
    FIELD(import_fields, vsplat_import_options, fields),
    FUNCTION(model, vsplat_model_load),
    FIELD(model_fields, vsplat_model_options, fields),
    FUNCTION(model_init, vsplat_model_init),

    FIELD(evaluate_devices, vsplat_evaluate_options, more_devices),
    FIELD(evaluate_fit, vsplat_evaluate_options, refine),
    FIELD(evaluate_size, vsplat_evaluate_options, picture_size),
    FIELD(evaluate_supersample, vsplat_evaluate_options, supersample),
    FIELD(evaluate_view_count, vsplat_evaluate_options, view_count),
    FIELD(pose_draws, vsplat_evaluate_options, pose_draws),
    FIELD(pose_noise, vsplat_evaluate_options, pose_noise),
    FIELD(data, vsplat_train_options, data),
    FIELD(extend, vsplat_train_options, extend),
    FUNCTION(texture, vsplat_mesh_load),
    FIELD(textures, vsplat_train_options, textures),
    FUNCTION(train, vsplat_train),
    FIELD(train_assume_selected, vsplat_train_options, assume_selected),
    FIELD(train_devices, vsplat_train_options, more_devices),
    FUNCTION(train_plan, vsplat_train_plan),
    FIELD(train_resume, vsplat_train_options, resume),

    FUNCTION(doctor, vsplat_doctor),
    FUNCTION(selftest, vsplat_selftest),
    FUNCTION(tune, vsplat_tune),
    FIELD(tune_table, vsplat_tune_options, path),
};
#undef FIELD
#undef FUNCTION

constexpr bool in_order() {
  for (std::size_t i = 0; i < std::size(c_names); ++i)
    if (c_names[i].option != static_cast<Option>(i)) return false;
  return std::size(c_names) == kOptions;
}
static_assert(in_order(), "c_names has every Option, in the order of VSPLAT_OPTIONS");

OptionNames names_of_c() {
  OptionNames out;
  for (std::size_t i = 0; i < kOptions; ++i) out[i] = c_names[i].name;
  return out;
}

[[maybe_unused]] const bool at_load = (set_option_names(names_of_c()), true);

}  // namespace

vsplat_status vsplat_option_names_set(const char* const* fields, const char* const* names, size_t count) {
  return api::guarded([&] {
    api::need_array(fields, count, "fields");
    api::need_array(names, count, "names");
    OptionNames out = names_of_c();
    for (std::size_t i = 0; i < count; ++i) {
      api::need(fields[i], "a name in fields");
      api::need(names[i], "a name in names");
      const std::string_view field = fields[i];
      const auto* known =
          std::find_if(std::begin(c_names), std::end(c_names), [&](const CName& c) { return field == c.name; });
      if (known == std::end(c_names)) fail(Status::usage, "fields[{}] is {}: no message names that", i, field);
      out[static_cast<std::size_t>(known->option)] = names[i];
    }
    set_option_names(std::move(out));
  });
}
