# VSPLAT_LIMITS lets this device stand in for smaller ones: runs operations in the kernel variants that such devices get, against their
# references. With launches split into parts, and with few groups per dimension, it runs every operation, since each kernel must know its
# place. cli_limits runs whole jobs. The quick tests cover the limits that lead to different variants; the slow tests the others.
set(ops_with_variants *Attention*:*Conv3d*:*LayerNorm*:*RadixSort*:*Rasterize*:*TileBin*:*Transpose*:*Scan*:*Confidence*:*TopK*)
set(runtime_with_variants *Gemm*:*ColumnSum*:*ComposeRows*:*Variants*)
function(vsplat_limits_test name program limits filter)
  add_test(NAME limits.${program}.${name} COMMAND ${program}_tests --gtest_brief=1 --gtest_filter=${filter})
  set_tests_properties(limits.${program}.${name} PROPERTIES LABELS unit TIMEOUT 600 COST 100
    ENVIRONMENT "VSPLAT_LIMITS=${limits};${sanitizer_environment}")
endfunction()
foreach(program ops runtime)
  set(some "${${program}_with_variants}")
  vsplat_limits_test(groups_of_128 ${program} group=128 "${some}")
  vsplat_limits_test(groups_of_64 ${program} group=64 "${some}")
  vsplat_limits_test(local_16k ${program} local=16K "${some}")
  vsplat_limits_test(local_32k ${program} local=32K "${some}")
  vsplat_limits_test(others ${program} buffer=128M,memory=2G,fp64=0,fp16=0,subgroups=0,align=4096,size=32 "${some}")
endforeach()
vsplat_limits_test(parts ops flops=1e5,grid=5 "*")
vsplat_limits_test(parts runtime flops=1e5,grid=5 "${runtime_with_variants}")
foreach(limit groups_of_128 groups_of_64 local_memory_of_32k local_memory_of_16k small_buffers no_doubles wide_alignment sizes_of_32_bits parts few_groups_a_side bad_limits)
  vsplat_cli_test(cli_limits.${limit} limits_test.py Limits.test_${limit} LABELS cli)
endforeach()
vsplat_cli_test(cli_limits.planned limits_test.py Planned LABELS cli)
set_tests_properties(limits.ops.groups_of_64 limits.ops.local_16k limits.ops.local_32k limits.ops.others limits.ops.parts limits.runtime.local_32k
  limits.runtime.others PROPERTIES LABELS "unit;slow")
set_tests_properties(cli_limits.groups_of_64 cli_limits.local_memory_of_32k cli_limits.no_doubles cli_limits.wide_alignment
  cli_limits.sizes_of_32_bits cli_limits.few_groups_a_side PROPERTIES LABELS "cli;slow")
