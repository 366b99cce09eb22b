# The whole networks again on other OpenCL implementations, if installed: micro and tiny on rusticl's llvmpipe, and micro under the Oclgrind
# interpreter, which fails on an access out of bounds or a data race. Also drawing, on small scenes.

# A filter that selects no test (for instance because a test was renamed) is a failure. A run counts as skipped if its output ends with the
# list of skipped tests: after failures it ends with a list of those.
set(nothing_ran "Running 0 tests")
set(some_skipped "SKIPPED \\] [0-9]+ tests?, listed below:\n(\\[  SKIPPED \\] [^\n]*\n?)*$")
if(EXISTS /etc/OpenCL/vendors/rusticl.icd)
  set(on_rusticl "OCL_ICD_VENDORS=/etc/OpenCL/vendors/rusticl.icd;RUSTICL_ENABLE=llvmpipe;VSPLAT_DEVICE=llvmpipe")
  if(VSPLAT_SANITIZE)
    # llvmpipe registers its kernels' stack frames, and the first search for a frame sorts them under a lock, in memory for which the sanitizer
    # would record a full call stack, which searches for frames again. So the sanitizer must not record full stacks, nor search for leaks.
    list(APPEND on_rusticl "ASAN_OPTIONS=fast_unwind_on_malloc=1:intercept_tls_get_addr=0:detect_leaks=0")
  endif()
  function(vsplat_rusticl_test name program filter)
    add_test(NAME rusticl.${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/support/on_rusticl.sh $<TARGET_FILE:vsplat_cli>
      $<TARGET_FILE:${program}> --gtest_filter=${filter})
    set_tests_properties(rusticl.${name} PROPERTIES LABELS "model;drivers" TIMEOUT 600 COST 200 ${ARGN} ENVIRONMENT "${on_rusticl}"
      SKIP_RETURN_CODE 77 FAIL_REGULAR_EXPRESSION "${nothing_ran}" SKIP_REGULAR_EXPRESSION "${some_skipped}")
  endfunction()
  set(tiny FIXTURES_REQUIRED golden_tiny)
  vsplat_rusticl_test(network network_tests
    *GoldenModel*micro:*GoldenModel*_tiny:*GoldenModel*tiny_noise:*GoldenModel*tiny_views6:*Model/Model.*:*Dinov3*micro_square:*RayPredictor*micro_predictor
    ${tiny})
  vsplat_rusticl_test(lara lara_tests Kernels/LaraVectors.*lara_micro:*Lara/Lara.* ${tiny})
  vsplat_rusticl_test(lara_tiny lara_tests Kernels/LaraVectors.*lara_tiny ${tiny})
  vsplat_rusticl_test(genden genden_tests Kernels/GendenVectors.*genden_micro ${tiny})
  vsplat_rusticl_test(genden_tiny genden_tests Kernels/*Vectors.*genden_tiny ${tiny})
  # These two take minutes.
  set_tests_properties(rusticl.genden_tiny rusticl.lara_tiny PROPERTIES LABELS "model;drivers;slow" TIMEOUT 1800)
  vsplat_rusticl_test(surface_loss ops_tests *SurfaceLossOp* ${tiny})
  vsplat_rusticl_test(profile runtime_tests *ProfilesTimesThatCanBe:*FinishesWhatWasFlushed TIMEOUT 300)
  vsplat_rusticl_test(render splat_tests Committed/RenderGolden.*:CommittedSurfels/RenderGolden.* TIMEOUT 300)
  vsplat_rusticl_test(gradient splat_tests Committed/RenderBackwardGolden.*:CommittedSurfels/RenderBackwardGolden.*:*IsZeroWhereTheLossIs* TIMEOUT 300)
else()
  vsplat_left_out("No rusticl (Debian: mesa-opencl-icd): its tests are left out")
endif()
find_program(OCLGRIND oclgrind)
if(OCLGRIND AND NOT VSPLAT_SANITIZE)
  # By default oclgrind reports errors and continues; here every report is a failure.
  function(vsplat_oclgrind_test name program filter)
    add_test(NAME oclgrind.${name} COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:${program}> --gtest_filter=${filter})
    set_tests_properties(oclgrind.${name} PROPERTIES LABELS "model;drivers" TIMEOUT 900 COST 200 SKIP_REGULAR_EXPRESSION "${some_skipped}"
      FAIL_REGULAR_EXPRESSION "Invalid (read|write|argument)|[Rr]ace|OCLGRIND|errors generated|${nothing_ran}")
  endfunction()
  vsplat_oclgrind_test(network.cpu network_tests *GoldenModel*cpu_micro)
  vsplat_oclgrind_test(network.gpu network_tests *GoldenModel*gpu_micro)
  vsplat_oclgrind_test(render splat_tests Committed/RenderGolden.*near:Committed/RenderGolden.*empty)
  vsplat_oclgrind_test(gradient splat_tests Committed/RenderBackwardGolden.*seventeen)
  # The gradient tests of these scenes include drawing.
  vsplat_oclgrind_test(more_scenes splat_tests Committed/RenderGolden.*seventeen:Committed/RenderBackwardGolden.*_one)
  vsplat_oclgrind_test(surfels splat_tests CommittedSurfels/RenderBackwardGolden.*prime)
  vsplat_oclgrind_test(extensions network_tests *Dinov3*cpu_dinov3_micro_square)
  vsplat_oclgrind_test(predictor network_tests *RayPredictorVectors*cpu_share_micro_predictor)
  foreach(system lara genden)
    foreach(what EveryStage EveryGradient)
      vsplat_oclgrind_test(${system}.${what} ${system}_tests *Vectors.${what}Matches/cpu_${system}_micro)
    endforeach()
  endforeach()
  # Takes half a minute to two: all items of a work-group are interpreted, and so small a network fills little of its tiles.
  set_tests_properties(oclgrind.predictor oclgrind.gradient oclgrind.more_scenes oclgrind.network.gpu oclgrind.lara.EveryGradient oclgrind.genden.EveryStage
    oclgrind.genden.EveryGradient PROPERTIES LABELS "model;drivers;slow")
elseif(NOT OCLGRIND)
  vsplat_left_out("No oclgrind (Debian: oclgrind): its tests are left out")
endif()

# Compiles the kernels with GPU drivers' compilers: nothing may spill, and no row of the table may get worse. Quick: kernels that have
# changed since the table was written; slow: all, three minutes on one processor. A build with sanitizers has the same kernels.
find_program(CLANG_15 clang-15)
if(NOT CLANG_15 OR NOT EXISTS /usr/lib/clc/nvptx64--.bc)
  vsplat_left_out("No clang-15 or libclc-15 (Debian 12 has them), by which the table of GPU compilers was made: gpu_static* are left out")
elseif(NOT VSPLAT_SANITIZE)
  set(gpu_table ${PROJECT_SOURCE_DIR}/bench/results/gpu-compilers.txt)
  set(static_check ${CMAKE_CURRENT_SOURCE_DIR}/gpu/run.sh $<TARGET_FILE:vsplat_cli> ${PROJECT_BINARY_DIR}/gpu_static --baseline ${gpu_table})
  add_test(NAME gpu_static COMMAND ${static_check})
  add_test(NAME gpu_static_anew COMMAND ${static_check} --anew)
  set_tests_properties(gpu_static_anew PROPERTIES LABELS "drivers;slow" TIMEOUT 1800 SKIP_RETURN_CODE 77 PROCESSORS 2 DEPENDS gpu_static
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
  add_test(NAME gpu_static_check COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/gpu/static_check_test.py StaticCheck)
  add_test(NAME gpu_static_ptxas COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/gpu/static_check_test.py Assembler)
  set_tests_properties(gpu_static_check gpu_static_ptxas PROPERTIES LABELS drivers TIMEOUT 120 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
  set_tests_properties(gpu_static PROPERTIES LABELS drivers TIMEOUT 900 COST 300 SKIP_RETURN_CODE 77 PROCESSORS 2
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
endif()
