// Where the fields of public structs lie, to detect a caller's struct size that ends within a field.
#pragma once
#include <cstddef>
#include <span>

#include "vsplat/vsplat.h"

namespace vsplat::api {

struct FieldBytes {
  std::size_t begin, end;
};

// The fields of T that are longer than eight bytes. (All others lie within eight bytes that begin at a multiple of
// eight.) The test `functions` checks that none is missing.
template <class T>
std::span<const FieldBytes> long_fields() {
  return {};
}

#define VSPLAT_LONG_FIELD(T, field) \
  FieldBytes { offsetof(T, field), offsetof(T, field) + sizeof(T::field) }
#define VSPLAT_LONG_FIELDS(T, ...)                        \
  template <>                                             \
  inline std::span<const FieldBytes> long_fields<T>() {   \
    static constexpr FieldBytes fields[] = {__VA_ARGS__}; \
    return fields;                                        \
  }

VSPLAT_LONG_FIELDS(vsplat_camera, VSPLAT_LONG_FIELD(vsplat_camera, w2c), VSPLAT_LONG_FIELD(vsplat_camera, lens_values))
VSPLAT_LONG_FIELDS(vsplat_view, VSPLAT_LONG_FIELD(vsplat_view, camera))
VSPLAT_LONG_FIELDS(vsplat_dataset_object, VSPLAT_LONG_FIELD(vsplat_dataset_object, center))
VSPLAT_LONG_FIELDS(vsplat_device_info, VSPLAT_LONG_FIELD(vsplat_device_info, name),
                   VSPLAT_LONG_FIELD(vsplat_device_info, vendor), VSPLAT_LONG_FIELD(vsplat_device_info, driver),
                   VSPLAT_LONG_FIELD(vsplat_device_info, version), VSPLAT_LONG_FIELD(vsplat_device_info, platform_name),
                   VSPLAT_LONG_FIELD(vsplat_device_info, uuid), VSPLAT_LONG_FIELD(vsplat_device_info, tuning),
                   VSPLAT_LONG_FIELD(vsplat_device_info, limits), VSPLAT_LONG_FIELD(vsplat_device_info, switched_off),
                   VSPLAT_LONG_FIELD(vsplat_device_info, matrix_unit))
VSPLAT_LONG_FIELDS(vsplat_evaluate_options, VSPLAT_LONG_FIELD(vsplat_evaluate_options, center))
VSPLAT_LONG_FIELDS(vsplat_input_info, VSPLAT_LONG_FIELD(vsplat_input_info, center),
                   VSPLAT_LONG_FIELD(vsplat_input_info, up))
VSPLAT_LONG_FIELDS(vsplat_input_options, VSPLAT_LONG_FIELD(vsplat_input_options, center))
VSPLAT_LONG_FIELDS(vsplat_measure_options, VSPLAT_LONG_FIELD(vsplat_measure_options, background))
VSPLAT_LONG_FIELDS(vsplat_orbit_options, VSPLAT_LONG_FIELD(vsplat_orbit_options, up))
VSPLAT_LONG_FIELDS(vsplat_plan, VSPLAT_LONG_FIELD(vsplat_plan, stages))
VSPLAT_LONG_FIELDS(vsplat_profile_row, VSPLAT_LONG_FIELD(vsplat_profile_row, kernel),
                   VSPLAT_LONG_FIELD(vsplat_profile_row, stage))
VSPLAT_LONG_FIELDS(vsplat_reconstruct_options, VSPLAT_LONG_FIELD(vsplat_reconstruct_options, up))
VSPLAT_LONG_FIELDS(vsplat_fit_options, VSPLAT_LONG_FIELD(vsplat_fit_options, background_colour))
VSPLAT_LONG_FIELDS(vsplat_fit_result, VSPLAT_LONG_FIELD(vsplat_fit_result, background))
VSPLAT_LONG_FIELDS(vsplat_fit_progress, VSPLAT_LONG_FIELD(vsplat_fit_progress, phase))
VSPLAT_LONG_FIELDS(vsplat_render_options, VSPLAT_LONG_FIELD(vsplat_render_options, background))
VSPLAT_LONG_FIELDS(vsplat_scene_edit_options, VSPLAT_LONG_FIELD(vsplat_scene_edit_options, box_low),
                   VSPLAT_LONG_FIELD(vsplat_scene_edit_options, box_high),
                   VSPLAT_LONG_FIELD(vsplat_scene_edit_options, sphere_centre),
                   VSPLAT_LONG_FIELD(vsplat_scene_edit_options, up),
                   VSPLAT_LONG_FIELD(vsplat_scene_edit_options, translation))
VSPLAT_LONG_FIELDS(vsplat_scene_file, VSPLAT_LONG_FIELD(vsplat_scene_file, version))
VSPLAT_LONG_FIELDS(vsplat_scene_mesh_options, VSPLAT_LONG_FIELD(vsplat_scene_mesh_options, center))
VSPLAT_LONG_FIELDS(vsplat_scene_statistics, VSPLAT_LONG_FIELD(vsplat_scene_statistics, low),
                   VSPLAT_LONG_FIELD(vsplat_scene_statistics, high), VSPLAT_LONG_FIELD(vsplat_scene_statistics, low_1),
                   VSPLAT_LONG_FIELD(vsplat_scene_statistics, high_99))
VSPLAT_LONG_FIELDS(vsplat_scene_info, VSPLAT_LONG_FIELD(vsplat_scene_info, mirror),
                   VSPLAT_LONG_FIELD(vsplat_scene_info, up), VSPLAT_LONG_FIELD(vsplat_scene_info, offset),
                   VSPLAT_LONG_FIELD(vsplat_scene_info, detail_middle))

#undef VSPLAT_LONG_FIELDS
#undef VSPLAT_LONG_FIELD

// Refuses a caller's size of a struct that has `known` bytes here, if it is too small to hold anything or ends within a
// field. `what` names the struct.
void check_struct_size(std::size_t size, std::size_t known, std::span<const FieldBytes> longer, const char* what);

}  // namespace vsplat::api
