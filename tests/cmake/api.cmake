# The public header as C programs use it.
foreach(name c99_test cancel_test edit_test fit_api_test gradient_test jobs_test lifetimes_test memory_test opencl_bytes_test opencl_test
    pictures_test share_test threads_test train_api_test)
  add_executable(${name} model/api/${name}.c)
  target_link_libraries(${name} PRIVATE vsplat m)
  vsplat_target(${name})
  add_test(NAME ${name} COMMAND ${name})
  set_tests_properties(${name} PROPERTIES LABELS unit TIMEOUT 120 ENVIRONMENT "${sanitizer_environment}")
endforeach()
add_executable(cpp_test model/api/cpp_test.cpp)
target_link_libraries(cpp_test PRIVATE vsplat)
vsplat_target(cpp_test)
add_test(NAME cpp_test COMMAND cpp_test)
set_tests_properties(cpp_test PROPERTIES LABELS unit TIMEOUT 120 ENVIRONMENT "${sanitizer_environment}")
# Training a network and stopping it, at a size with long launches: a minute on two processors.
# Slow, because it checks times, which for a training include those of the disk.
set_tests_properties(cancel_test PROPERTIES LABELS "unit;slow" TIMEOUT 600 COST 200 PROCESSORS 2)
target_compile_definitions(pictures_test PRIVATE _POSIX_C_SOURCE=200809L)  # for a temporary folder
find_package(Threads REQUIRED)
foreach(name cancel_test fit_api_test jobs_test lifetimes_test memory_test opencl_test share_test threads_test train_api_test)
  target_compile_definitions(${name} PRIVATE _POSIX_C_SOURCE=200809L _DEFAULT_SOURCE)
  target_link_libraries(${name} PRIVATE Threads::Threads)
endforeach()

target_link_libraries(opencl_bytes_test PRIVATE OpenCL::OpenCL)
target_link_libraries(opencl_test PRIVATE OpenCL::OpenCL)

# Slow: 500 cycles, each of which opens a device.
add_executable(cycles_test model/api/cycles_test.c)
target_link_libraries(cycles_test PRIVATE vsplat)
target_compile_definitions(cycles_test PRIVATE _POSIX_C_SOURCE=200809L)
vsplat_target(cycles_test)
add_test(NAME cycles_test COMMAND cycles_test)
set_tests_properties(cycles_test PROPERTIES LABELS "unit;slow" TIMEOUT 1800 ENVIRONMENT "${sanitizer_environment}")

# Slow: a thousand frames of a million Gaussians. Runs alone, because it compares their time with the kernels'.
add_executable(frames_test model/api/frames_test.c)
target_link_libraries(frames_test PRIVATE vsplat OpenCL::OpenCL)
target_compile_definitions(frames_test PRIVATE _POSIX_C_SOURCE=200809L)
vsplat_target(frames_test)
add_test(NAME frames_scene COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh bench_scenes.py ${CMAKE_CURRENT_BINARY_DIR}/frames)
set_tests_properties(frames_scene PROPERTIES LABELS "unit;slow" TIMEOUT 600 SKIP_RETURN_CODE 77 FIXTURES_SETUP frames)
add_test(NAME frames_test COMMAND frames_test ${CMAKE_CURRENT_BINARY_DIR}/frames/slab-1m.ply ${CMAKE_CURRENT_BINARY_DIR}/frames/slab-1m.cameras.json)
set_tests_properties(frames_test PROPERTIES LABELS "unit;slow" TIMEOUT 1800 FIXTURES_REQUIRED frames RUN_SERIAL ON
  ENVIRONMENT "${sanitizer_environment}")

# The example that fits Gaussians to a picture must reduce its loss to a hundredth.
add_test(NAME fit_example COMMAND fit_example ${CMAKE_CURRENT_BINARY_DIR}/fit_before.png ${CMAKE_CURRENT_BINARY_DIR}/fit_after.png)
set_tests_properties(fit_example PROPERTIES LABELS unit TIMEOUT 300 ENVIRONMENT "${sanitizer_environment}")

# The built-in model: a C program and the command, each with a library that contains a model with random weights, and with one that contains
# none. These libraries are the library's own objects, linked again.
set(variants ${CMAKE_CURRENT_BINARY_DIR}/variants)
set(micro ${variants}/micro.safetensors)
add_custom_command(OUTPUT ${micro} COMMAND vsplat_cli init micro --seed 3 --output ${micro} --overwrite --quiet DEPENDS vsplat_cli
  COMMENT "Making a model to carry" VERBATIM)
set_source_files_properties(${PROJECT_SOURCE_DIR}/model/networks/params/built_in_model.S PROPERTIES OBJECT_DEPENDS ${micro})
foreach(carried micro none)
  add_library(vsplat_carrying_${carried} SHARED ${PROJECT_SOURCE_DIR}/model/networks/params/built_in_model.S $<TARGET_OBJECTS:vsplat>
    $<TARGET_OBJECTS:vsplat_kernels>)
  target_link_libraries(vsplat_carrying_${carried} PRIVATE vsplat_model nlohmann_json::nlohmann_json)
  target_link_options(vsplat_carrying_${carried} PRIVATE LINKER:--version-script=${PROJECT_SOURCE_DIR}/cmake/vsplat.map)
  set_target_properties(vsplat_carrying_${carried} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${variants}/${carried} OUTPUT_NAME vsplat
    VERSION ${VSPLAT_SOVERSION}.${PROJECT_VERSION} SOVERSION ${VSPLAT_SOVERSION})
  vsplat_target(vsplat_carrying_${carried})
endforeach()
target_compile_definitions(vsplat_carrying_micro PRIVATE VSPLAT_MODEL_FILE="${micro}")
add_executable(built_in_model_test model/api/built_in_model_test.c)
target_link_libraries(built_in_model_test PRIVATE vsplat)
vsplat_target(built_in_model_test)
foreach(carried micro none)
  add_test(NAME built_in_model.${carried}
    COMMAND built_in_model_test ${carried} ${CMAKE_CURRENT_BINARY_DIR}/built_in_model.safetensors)
  set_tests_properties(built_in_model.${carried} PROPERTIES LABELS unit TIMEOUT 120
    ENVIRONMENT "LD_LIBRARY_PATH=${variants}/${carried};${sanitizer_environment}")
endforeach()
