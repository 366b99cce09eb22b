# Golden vectors: those of micro are committed, the larger ones are made by PyTorch, where it is there. Where it is not, this
# test and the cases that need them are reported as skipped.
set(golden_dir ${PROJECT_BINARY_DIR}/golden)
add_library(vsplat_golden STATIC support/golden.cpp support/splat_golden.cpp)
target_link_libraries(vsplat_golden PUBLIC vsplat_model)
# (A target's definition would be part of what is precompiled.)
set_source_files_properties(support/golden.cpp support/splat_golden.cpp PROPERTIES
  COMPILE_DEFINITIONS "VSPLAT_SOURCE_DIR=\"${PROJECT_SOURCE_DIR}\";VSPLAT_GOLDEN_DIR=\"${golden_dir}\"")
vsplat_target(vsplat_golden)
vsplat_optimize(vsplat_golden -O0)
# As the programs that take it, whose precompiled headers it holds.
set_target_properties(vsplat_golden PROPERTIES POSITION_INDEPENDENT_CODE OFF)
target_compile_options(vsplat_golden PRIVATE -fPIE)
target_link_libraries(vsplat_golden PUBLIC GTest::gtest)
vsplat_precompile(vsplat_golden ${tests_precompile})
# (What others wait for is begun first.)
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
