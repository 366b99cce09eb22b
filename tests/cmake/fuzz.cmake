# Damaged and malicious files: every build reads the fuzzers' seeds and the inputs that they have found. The fuzzers themselves are slow
# tests, a minute each with any seed; they are built by another compiler.
vsplat_tests(fuzz_replay_test
  fuzz/kernel_cache.cpp
  fuzz/picture.cpp
  fuzz/scenes.cpp
  fuzz/reader.cpp
  fuzz/replay_test.cpp
  fuzz/targets.cpp
  fuzz/tensors.cpp
  fuzz/texts.cpp
  fuzz/torch.cpp
  fuzz/views.cpp
  LABELS unit LIBS vsplat_messages)
include(fuzz/targets.cmake)
target_compile_definitions(fuzz_replay_test PRIVATE VSPLAT_FUZZ_DATA="${CMAKE_CURRENT_SOURCE_DIR}/fuzz")
find_program(VSPLAT_CLANGXX clang++)
set(fuzzer_runtime)
if(VSPLAT_CLANGXX)
  execute_process(COMMAND ${VSPLAT_CLANGXX} -print-file-name=libclang_rt.fuzzer-${CMAKE_SYSTEM_PROCESSOR}.a
    OUTPUT_VARIABLE fuzzer_runtime OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(VSPLAT_SANITIZE)
  # One build of the fuzzers is enough, since it has its own sanitizers.
elseif(EXISTS "${fuzzer_runtime}")
  set(fuzz ${CMAKE_CURRENT_SOURCE_DIR}/fuzz/run.sh)
  add_test(NAME fuzz.build COMMAND ${fuzz} build)
  set_tests_properties(fuzz.build PROPERTIES LABELS "fuzz;slow" TIMEOUT 600 FIXTURES_SETUP fuzz)
  foreach(target ${VSPLAT_FUZZ_TARGETS})
    add_test(NAME fuzz.${target} COMMAND ${fuzz} run 60 ${target})
    set_tests_properties(fuzz.${target} PROPERTIES LABELS "fuzz;slow" TIMEOUT 300 FIXTURES_REQUIRED fuzz)
  endforeach()
else()
  vsplat_left_out("No libFuzzer (Debian: clang, libclang-rt-dev): the fuzzers are left out")
endif()
