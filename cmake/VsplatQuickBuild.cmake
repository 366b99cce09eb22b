# What continuous integration builds with (`tests/run.sh --strict`): a clean build takes a third less of the processor.
#   vsplat_precompile(TARGET <header>...)  system headers that most sources of a target include, parsed once. None of ours is among
#                                          them, since a change of it would compile everything anew.
#   vsplat_precompile_as(TARGET OTHER)     those of OTHER, which is compiled with the same options
#   vsplat_quick_test(TARGET)              what tests compute for comparison is small, and the command computes nothing: -O1
# Without it sources are found that do not include what they use; the linter and the fuzzers see them so, too.
option(VSPLAT_QUICK_BUILD "Precompile system headers, and compile tests and the command with -O1" OFF)
function(vsplat_precompile target)
  if(VSPLAT_QUICK_BUILD)
    target_precompile_headers(${target} PRIVATE ${ARGN})
    vsplat_precompiled_options(${target})
  endif()
endfunction()
function(vsplat_precompile_as target other)
  if(VSPLAT_QUICK_BUILD)
    target_precompile_headers(${target} REUSE_FROM ${other})
    vsplat_precompiled_options(${target})
  endif()
endfunction()
function(vsplat_quick_test target)
  if(VSPLAT_QUICK_BUILD)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
endfunction()
function(vsplat_precompiled_options target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # False alarms of GCC 12 in std::string (its bug 105651), which it keeps to itself where the header was not precompiled.
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-stringop-overflow -Wno-array-bounds>)
  endif()
endfunction()
