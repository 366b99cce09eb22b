# What continuous integration and the sanitizers build with (`tests/run.sh --strict`, `--asan`): a clean build takes half of the
# processor's time.
#   vsplat_precompile(TARGET <header>...)  system headers that most sources of a target include, parsed once. None of ours is among
#                                          them, since everything would be compiled again after a change of it.
#   vsplat_precompile_as(TARGET OTHER)     those of OTHER, which is compiled with the same options
#   vsplat_optimize(TARGET LEVEL)          not by -O3: tests and the command compute little of their own
#   vsplat_together(TARGET FOLDERS <folder>... [ALONE <source>...])
#                                          each folder's sources are compiled as one: most of the time goes into headers. All but those
#                                          that stand alone: they have names in their unnamed namespaces that others there have, too.
# Without it sources are found that do not include what they use; the linter and the fuzzers see them so, too.
option(VSPLAT_QUICK_BUILD "Precompile system headers, join sources, and hardly optimise tests and the command" OFF)
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
function(vsplat_optimize target level)
  if(VSPLAT_QUICK_BUILD)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:${level}>)
  endif()
endfunction()
function(vsplat_together target)
  cmake_parse_arguments(T "" "" "FOLDERS;ALONE" ${ARGN})
  if(VSPLAT_QUICK_BUILD)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
    get_target_property(sources ${target} SOURCES)
    foreach(source ${sources})
      get_filename_component(folder ${source} DIRECTORY)
      if("./${folder}" IN_LIST T_FOLDERS AND NOT source IN_LIST T_ALONE)
        string(MAKE_C_IDENTIFIER "${folder}" group)
        set_source_files_properties(${source} PROPERTIES UNITY_GROUP "together_${group}")
      endif()
    endforeach()
    if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
      # A tenth of the compiler's time goes into looking for memory that it could use again: not before it has taken 2 GiB.
      target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=2097152>)
      # Types and names of unnamed namespaces are no longer the main source's, and the other sources see them.
      target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage -Wno-shadow>)
    endif()
  endif()
endfunction()
function(vsplat_precompiled_options target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # False alarms of GCC 12 in std::string (its bug 105651), which it keeps to itself where the header was not precompiled.
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-stringop-overflow -Wno-array-bounds>)
  endif()
endfunction()
