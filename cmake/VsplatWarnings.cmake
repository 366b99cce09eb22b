# vsplat_target(name): our warnings, as errors where VSPLAT_WERROR says so, and the sanitizers where they are asked for. Each compiler has
# warnings of its own: whoever only builds this is not to be stopped by a newer one.
function(vsplat_target name)
  target_compile_options(${name} PRIVATE -Wall -Wextra -Wpedantic $<$<BOOL:${VSPLAT_WERROR}>:-Werror> -Wshadow
    -Wno-restrict  # false alarms of GCC 12 in std::string (its bug 105651)
    $<$<COMPILE_LANGUAGE:CXX>:-Wnon-virtual-dtor -Woverloaded-virtual -Wextra-semi>)
  if(VSPLAT_SANITIZE)
    target_compile_options(${name} PRIVATE -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer)
    target_link_options(${name} PUBLIC -fsanitize=address,undefined)
  endif()
endfunction()
