# vsplat_target(name): enables our warnings, as errors with VSPLAT_WERROR, and the sanitizers on request. By default warnings are no errors,
# since each compiler has its own, and a newer compiler must not stop a user's build.
function(vsplat_target name)
  set(gcc_13 $<COMPILE_LANG_AND_ID:CXX,GNU>,$<VERSION_GREATER_EQUAL:$<CXX_COMPILER_VERSION>,13>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,14>)
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wpedantic $<$<BOOL:${VSPLAT_WERROR}>:-Werror> -Wshadow
    -Wno-restrict  # false alarms of GCC 12 in std::string (its bug 105651)
    $<$<AND:${gcc_13}>:-Wno-array-bounds -Wno-maybe-uninitialized -Wno-stringop-overflow>  # false alarms of GCC 13 in fmt 9 and Eigen 3.4, Ubuntu 24.04's
    $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual -Wextra-semi>)
  if(VSPLAT_SANITIZE)
    target_compile_options(${name} PRIVATE -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${name} PUBLIC -fsanitize=address,undefined)
  endif()
endfunction()
