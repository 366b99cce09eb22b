# The whole networks again on other OpenCL implementations, if installed: micro and tiny on rusticl's llvmpipe, and micro under the Oclgrind
# interpreter, which fails on an access out of bounds or a data race. Also drawing, on small scenes.

# A filter that selects no test (for instance because a test was renamed) is a failure. A run counts as skipped if its output ends with the
# list of skipped tests: after failures it ends with a list of those.
set(nothing_ran "Running 0 tests")
set(some_skipped "SKIPPED \\] [0-9]+ tests?, listed below:\n(\\[  SKIPPED \\] [^\n]*\n?)*$")
if(EXISTS /etc/OpenCL/vendors/rusticl.icd)
  set(on_rusticl "RUSTICL_ENABLE=llvmpipe;VSPLAT_DEVICE=llvmpipe")
  if(VSPLAT_SANITIZE)
    # llvmpipe registers its kernels' stack frames, and the first search for a frame sorts them under a lock, in memory for which the sanitizer
    # would record a full call stack, which searches for frames again. So the sanitizer must not record full stacks, nor search for leaks.
    list(APPEND on_rusticl "ASAN_OPTIONS=fast_unwind_on_malloc=1:intercept_tls_get_addr=0:detect_leaks=0")
  endif()
  add_test(NAME rusticl.network
    COMMAND network_tests --gtest_filter=*GoldenModel*micro:*GoldenModel*_tiny:*GoldenModel*tiny_noise:*GoldenModel*tiny_views6:*Model/Model.*:*Dinov3*micro_square:*RayPredictor*micro_predictor)
  set_tests_properties(rusticl.network PROPERTIES LABELS "model;drivers" TIMEOUT 600 COST 200 FIXTURES_REQUIRED golden_tiny
    FAIL_REGULAR_EXPRESSION "${nothing_ran}" SKIP_REGULAR_EXPRESSION "${some_skipped}"
    ENVIRONMENT "${on_rusticl}")
  add_test(NAME rusticl.lara COMMAND lara_tests --gtest_filter=Kernels/LaraVectors.*lara_micro:*Lara/Lara.*)
  add_test(NAME rusticl.lara_tiny COMMAND lara_tests --gtest_filter=Kernels/LaraVectors.*lara_tiny)
  add_test(NAME rusticl.genden COMMAND genden_tests --gtest_filter=Kernels/GendenVectors.*genden_micro)
  add_test(NAME rusticl.genden_tiny COMMAND genden_tests --gtest_filter=Kernels/*Vectors.*genden_tiny)
  add_test(NAME rusticl.surface_loss COMMAND ops_tests --gtest_filter=*SurfaceLossOp*)
  set_tests_properties(rusticl.lara rusticl.lara_tiny rusticl.genden rusticl.genden_tiny rusticl.surface_loss PROPERTIES LABELS "model;drivers" TIMEOUT 600 COST 200
    FIXTURES_REQUIRED golden_tiny FAIL_REGULAR_EXPRESSION "${nothing_ran}" SKIP_REGULAR_EXPRESSION "${some_skipped}"
    ENVIRONMENT "${on_rusticl}")
  # These two take minutes.
  set_tests_properties(rusticl.genden_tiny rusticl.lara_tiny PROPERTIES LABELS "model;drivers;slow" TIMEOUT 1800)
  add_test(NAME rusticl.profile COMMAND runtime_tests --gtest_filter=*ProfilesTimesThatCanBe)
  add_test(NAME rusticl.render COMMAND splat_tests --gtest_filter=Committed/RenderGolden.*:CommittedSurfels/RenderGolden.*)
  add_test(NAME rusticl.gradient COMMAND splat_tests --gtest_filter=Committed/RenderBackwardGolden.*:CommittedSurfels/RenderBackwardGolden.*:*IsZeroWhereTheLossIs*)
  set_tests_properties(rusticl.profile rusticl.render rusticl.gradient PROPERTIES LABELS "model;drivers" TIMEOUT 300 COST 200
    FAIL_REGULAR_EXPRESSION "${nothing_ran}" SKIP_REGULAR_EXPRESSION "${some_skipped}"
    ENVIRONMENT "${on_rusticl}")
else()
  vsplat_left_out("No rusticl (Debian: mesa-opencl-icd): its tests are left out")
endif()
find_program(OCLGRIND oclgrind)
if(OCLGRIND AND NOT VSPLAT_SANITIZE)
  foreach(flavour cpu gpu)
    add_test(NAME oclgrind.network.${flavour}
      COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:network_tests> --gtest_filter=*GoldenModel*${flavour}_micro)
  endforeach()
  add_test(NAME oclgrind.render
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:splat_tests> --gtest_filter=Committed/RenderGolden.*near:Committed/RenderGolden.*empty)
  add_test(NAME oclgrind.gradient
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:splat_tests> --gtest_filter=Committed/RenderBackwardGolden.*seventeen)
  # The gradient tests of these scenes include drawing.
  add_test(NAME oclgrind.more_scenes
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:splat_tests> --gtest_filter=Committed/RenderGolden.*seventeen:Committed/RenderBackwardGolden.*_one)
  add_test(NAME oclgrind.surfels
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:splat_tests> --gtest_filter=CommittedSurfels/RenderBackwardGolden.*prime)
  add_test(NAME oclgrind.extensions
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:network_tests> --gtest_filter=*Dinov3*cpu_dinov3_micro_square)
  add_test(NAME oclgrind.predictor
    COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:network_tests> --gtest_filter=*RayPredictorVectors*cpu_share_micro_predictor)
  foreach(system lara genden)
    foreach(what EveryStage EveryGradient)
      add_test(NAME oclgrind.${system}.${what}
        COMMAND ${OCLGRIND} --data-races --check-api $<TARGET_FILE:${system}_tests> --gtest_filter=*Vectors.${what}Matches/cpu_${system}_micro)
    endforeach()
  endforeach()
  # By default oclgrind reports errors and continues; here every report is a failure.
  set_tests_properties(oclgrind.lara.EveryStage oclgrind.lara.EveryGradient oclgrind.genden.EveryStage oclgrind.genden.EveryGradient oclgrind.extensions oclgrind.predictor oclgrind.network.cpu oclgrind.network.gpu oclgrind.render oclgrind.gradient oclgrind.more_scenes oclgrind.surfels PROPERTIES LABELS "model;drivers" TIMEOUT 900 COST 200
    SKIP_REGULAR_EXPRESSION "${some_skipped}"
    FAIL_REGULAR_EXPRESSION "Invalid (read|write|argument)|[Rr]ace|OCLGRIND|errors generated|${nothing_ran}")
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
  add_test(NAME gpu_static COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/gpu/run.sh $<TARGET_FILE:vsplat_cli> ${PROJECT_BINARY_DIR}/gpu_static
    --baseline ${gpu_table})
  add_test(NAME gpu_static_anew COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/gpu/run.sh $<TARGET_FILE:vsplat_cli> ${PROJECT_BINARY_DIR}/gpu_static
    --baseline ${gpu_table} --anew)
  set_tests_properties(gpu_static_anew PROPERTIES LABELS "drivers;slow" TIMEOUT 1800 SKIP_RETURN_CODE 77 PROCESSORS 2 DEPENDS gpu_static
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
  add_test(NAME gpu_static_check COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/gpu/static_check_test.py)
  set_tests_properties(gpu_static_check PROPERTIES LABELS drivers TIMEOUT 120 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
  set_tests_properties(gpu_static PROPERTIES LABELS drivers TIMEOUT 900 COST 300 SKIP_RETURN_CODE 77 PROCESSORS 2
    ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")
endif()
