# The quick build of tests/run.sh: a clean build takes half of the processor's time.
#   vsplat_precompile(TARGET <header>...)  precompiles system headers that most sources of a target include. Our own headers are not among
#                                          them, since a change of one would compile everything again.
#   vsplat_precompile_as(TARGET OTHER)     uses the precompiled headers of OTHER, which is compiled with the same options
#   vsplat_optimize(TARGET LEVEL)          replaces -O3: tests and the command compute little themselves
#   vsplat_together(TARGET FOLDERS <folder>... [ALONE <source>...])
#                                          compiles each folder's sources as one, since most of the time goes into headers. Sources listed
#                                          under ALONE have names in unnamed namespaces that other sources of the folder have, too.
# The ordinary build finds sources that do not include what they use (the slow test ordinary_build); so does the linter.
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
      # The compiler spends a tenth of its time on garbage collection; this starts it only from 2 GiB on.
      target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:--param=ggc-min-heapsize=2097152>)
      # Names in unnamed namespaces no longer belong to a main source, and the other sources of the unit see them.
      target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage -Wno-shadow>)
    endif()
  endif()
endfunction()
function(vsplat_precompiled_options target)
  if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
    # GCC 12 reports false alarms in std::string (its bug 105651), which it suppresses if the header is not precompiled.
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-stringop-overflow -Wno-array-bounds>)
  endif()
endfunction()
