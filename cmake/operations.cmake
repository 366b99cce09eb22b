# Every operation, FAMILY/NAME: one line makes of its files what they are (see "Adding an operation" in CONTRIBUTING.md).
#   cl/FAMILY/NAME.cl, model/ops/FAMILY/NAME.{h,cpp}, model/diagnose/selftest/cases/NAME.cpp, bench/ops/NAME.cpp,
#   tests/model/ops/FAMILY/NAME_test.cpp
set(VSPLAT_OPERATIONS
  dense/activation
  dense/add_columns
  dense/attention
  dense/conv3d
  dense/conv3d_up
  dense/cross_attention
  dense/gather
  dense/groupnorm
  dense/layer_scale
  dense/layernorm
  dense/patch_embed
  dense/position_resample
  dense/rope
  dense/scatter_rows
  dense/transpose
  volume/cell_map
  volume/compact
  volume/sample_points
  volume/select
  volume/space_curve
  volume/sparse_conv
  volume/sparse_map
  volume/top_k
  volume/upsample3d
  networks/confidence
  networks/decode
  networks/lara_maps
  networks/lift
  networks/plucker
  networks/position_encoding
  networks/project_features
  networks/ray_harmonics
  networks/ray_loss
  networks/upscale
  networks/view_maps
  render/area_mean
  render/project
  render/project_surfels
  render/radix_sort
  render/rasterize
  render/rasterize_surfels
  render/scan
  render/tile_bin
  render/visible
  fit/adamw
  fit/depth_loss
  fit/exposure
  fit/loss
  fit/lpips
  fit/muon
  fit/picture_target
  fit/sky_background
  fit/sparsity_loss
  fit/splat_adam
  fit/splat_filter
  fit/splat_parameters
  fit/splat_relocate
  fit/splat_split
  fit/surface_loss
)
# Operations of runtime/, which have cases of the self-test.
set(VSPLAT_RUNTIME_OPERATIONS column_sum compose_rows gemm peak)
set(VSPLAT_OPERATION_NAMES)
foreach(operation ${VSPLAT_OPERATIONS})
  get_filename_component(operation ${operation} NAME)
  list(APPEND VSPLAT_OPERATION_NAMES ${operation})
endforeach()

# vsplat_list_functions(OUTPUT TEMPLATE TYPE SUFFIX ARGUMENTS names...): makes OUTPUT of TEMPLATE, with a declaration
# `TYPE NAME_SUFFIX(ARGUMENTS);` and an entry `{"NAME", NAME_SUFFIX}` for each name.
function(vsplat_list_functions output template type suffix arguments)
  set(declarations)
  set(entries)
  foreach(name ${ARGN})
    string(APPEND declarations "${type} ${name}_${suffix}(${arguments});\n")
    string(APPEND entries "\n    {\"${name}\", ${name}_${suffix}},")
  endforeach()
  configure_file(${template} ${output} @ONLY)
endfunction()
