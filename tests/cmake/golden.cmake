# Golden vectors: those of micro are committed; PyTorch makes the larger ones if it is installed. Otherwise this test and the cases that
# need them are reported as skipped.
set(golden_dir ${PROJECT_BINARY_DIR}/golden)
add_library(vsplat_golden STATIC support/golden.cpp support/splat_golden.cpp)
target_link_libraries(vsplat_golden PUBLIC vsplat_model)
# (A definition on the target would become part of the precompiled headers.)
set_source_files_properties(support/golden.cpp support/splat_golden.cpp PROPERTIES
  COMPILE_DEFINITIONS "VSPLAT_SOURCE_DIR=\"${PROJECT_SOURCE_DIR}\";VSPLAT_GOLDEN_DIR=\"${golden_dir}\"")
vsplat_target(vsplat_golden)
target_link_libraries(vsplat_golden PUBLIC GTest::gtest)
vsplat_optimize(vsplat_golden -O0)
# Precompiled headers depend on the optimisation: those for tests whose references compute belong to a separate library.
add_library(tests_that_compute OBJECT support/precompiled.cpp)
target_link_libraries(tests_that_compute PRIVATE vsplat_model GTest::gtest)
vsplat_target(tests_that_compute)
vsplat_optimize(tests_that_compute -O1)
foreach(holder vsplat_golden tests_that_compute)
  # With the same options as the programs that use it.
  set_target_properties(${holder} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
  target_compile_options(${holder} PRIVATE -fPIE)
  vsplat_precompile(${holder}
    <gtest/gtest.h> <fmt/format.h> <algorithm> <array> <cmath> <filesystem> <fstream> <functional> <map> <memory> <optional>
      <random> <set> <string> <vector> <Eigen/Core> <Eigen/Geometry>)
endforeach()
# (Tests that others wait for begin first.)
add_test(NAME golden_tiny COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} tiny)
set_tests_properties(golden_tiny PROPERTIES FIXTURES_SETUP golden_tiny SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_tiny_slow COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} tiny_slow)
set_tests_properties(golden_tiny_slow PROPERTIES FIXTURES_SETUP golden_tiny_slow FIXTURES_REQUIRED golden_tiny LABELS slow
  SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_splat COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir}/splat splat)
set_tests_properties(golden_splat PROPERTIES FIXTURES_SETUP golden_splat FIXTURES_REQUIRED golden_tiny SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_surfels COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir}/splat surfels)
set_tests_properties(golden_surfels PROPERTIES FIXTURES_SETUP golden_splat SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_train COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} train)
set_tests_properties(golden_train PROPERTIES FIXTURES_SETUP golden_train FIXTURES_REQUIRED golden_tiny SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_train_slow COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} train_slow)
set_tests_properties(golden_train_slow PROPERTIES FIXTURES_SETUP golden_train_slow FIXTURES_REQUIRED "golden_train;golden_tiny_slow" LABELS slow
  SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
