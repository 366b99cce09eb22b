# vsplat_install_document(FILE NAME COMPONENT): installs a page of the source tree, without its links to files that are not installed.
function(vsplat_install_document file name component)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${file})
  file(READ ${file} text)
  string(REGEX REPLACE "\\[([^]\n]+)\\]\\([^)#:][^):]*\\)" "\\1" text "${text}")
  file(WRITE ${PROJECT_BINARY_DIR}/documents/${name} "${text}")
  install(FILES ${PROJECT_BINARY_DIR}/documents/${name} DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT ${component})
endfunction()
