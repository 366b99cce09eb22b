# vsplat_embed(OUT FUNCTION files...): makes a C++ source with a function (as in runtime/embedded.h) that returns the text of every file, so
# that an installed library needs no files beside it. It is made again whenever one of the files changes.
function(vsplat_embed out function)
  set(paths)
  foreach(file ${ARGN})
    list(APPEND paths ${CMAKE_CURRENT_SOURCE_DIR}/${file})
  endforeach()
  string(REPLACE ";" "|" joined "${paths}")
  add_custom_command(OUTPUT ${out}
    COMMAND ${CMAKE_COMMAND} -DOUT=${out} -DFUNCTION=${function} "-DFILES=${joined}" -P ${PROJECT_SOURCE_DIR}/cmake/embed.cmake
    DEPENDS ${paths} ${PROJECT_SOURCE_DIR}/cmake/embed.cmake
    COMMENT "Embedding for ${function}" VERBATIM)
  # A separate target, so that it does not wait for the libraries of the target whose source it makes.
  add_custom_target(${function}_text DEPENDS ${out})
endfunction()
