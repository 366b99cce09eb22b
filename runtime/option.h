// What messages tell a user to give or to call. C, Python and the command line name it differently, so a message holds
// an Option ("{}", Option::max_memory), which is spelled as the process's interface has set it.
#pragma once
#include <fmt/core.h>

#include <array>
#include <cstddef>
#include <string>

// clang-format off
#define VSPLAT_OPTIONS(X)                                                                                            \
  /* the process and its device */                                                                                   \
  X(allow_outside) X(device) X(gemm) X(kernels) X(max_host_memory) X(max_memory) X(precision)                         \
  /* views and the object's cube */                                                                                  \
  X(auto_frame) X(center) X(force) X(pictures) X(scale) X(skip_bad_views) X(view_count) X(views)                      \
  /* the network's passes and selection */                                                                           \
  X(assume_selected) X(fit_epochs) X(merge_cell) X(passes) X(selection) X(selection_seed)                            \
  /* scenes and drawing */                                                                                           \
  X(antialias) X(orbit_elevation) X(orbit_radius) X(skip_bad_gaussians) X(supersample) X(surfels_to_gaussians) X(up)  \
  /* a fit */                                                                                                        \
  X(background) X(fit_checkpoint) X(fit_depth) X(fit_extent) X(fit_resume) X(fit_views) X(freeze) X(holdout_count)    \
  X(holdout_names) X(invert_masks) X(longest) X(masks) X(max_gaussians) X(near_plane)                                 \
  /* models */                                                                                                       \
  X(import_config) X(import_fields) X(model) X(model_fields) X(model_init)                                            \
  /* training and evaluation */                                                                                      \
  X(evaluate_devices) X(evaluate_fit) X(evaluate_size) X(evaluate_supersample) X(evaluate_view_count) X(pose_draws)   \
  X(pose_noise) X(data) X(extend) X(texture) X(textures) X(train) X(train_assume_selected) X(train_devices)           \
  X(train_plan) X(train_resume)                                                                                      \
  /* diagnosis */                                                                                                    \
  X(doctor) X(selftest) X(tune) X(tune_table)

namespace vsplat {

#define VSPLAT_OPTION(name) name,
enum class Option { VSPLAT_OPTIONS(VSPLAT_OPTION) };
#undef VSPLAT_OPTION
// clang-format on

inline constexpr std::size_t kOptions = static_cast<std::size_t>(Option::tune_table) + 1;
using OptionNames = std::array<std::string, kOptions>;

// Its name in this process; where none is set, the enumerator's.
std::string option_name(Option option);

// For the whole process, thread-safe. An empty name keeps the enumerator's.
void set_option_names(OptionNames names);

}  // namespace vsplat

template <>
struct fmt::formatter<vsplat::Option> : fmt::formatter<fmt::string_view> {
  fmt::format_context::iterator format(vsplat::Option option, fmt::format_context& ctx) const;
};
