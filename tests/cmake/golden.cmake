# Golden vectors: those of micro are committed, the larger ones are made by PyTorch, where it is there. Where it is not, this
# test and the cases that need them are reported as skipped.
set(golden_dir ${PROJECT_BINARY_DIR}/golden)
add_library(vsplat_golden STATIC support/golden.cpp support/splat_golden.cpp)
target_link_libraries(vsplat_golden PUBLIC vsplat_model)
target_compile_definitions(vsplat_golden PUBLIC VSPLAT_SOURCE_DIR="${PROJECT_SOURCE_DIR}" PRIVATE VSPLAT_GOLDEN_DIR="${golden_dir}")
vsplat_target(vsplat_golden)
# (What others wait for is begun first.)
add_test(NAME golden_tiny COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} tiny)
set_tests_properties(golden_tiny PROPERTIES FIXTURES_SETUP golden_tiny SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_splat COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir}/splat splat)
set_tests_properties(golden_splat PROPERTIES FIXTURES_SETUP golden_splat FIXTURES_REQUIRED golden_tiny SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
add_test(NAME golden_train COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/golden/make.sh ${golden_dir} train)
set_tests_properties(golden_train PROPERTIES FIXTURES_SETUP golden_train SKIP_RETURN_CODE 77 TIMEOUT 900 COST 1000)
