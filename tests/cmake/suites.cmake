# vsplat_suites(PROGRAM PROPERTIES ... SLOW_PROPERTIES ...): makes a ctest test for each suite of a test program; a process for each case
# would take twice as long. To run one case: `PROGRAM --gtest_filter=SUITE.CASE`. The programs write which cases were skipped to
# test_cases/ (check_skipped.py).
set(test_cases_dir ${PROJECT_BINARY_DIR}/test_cases)
function(vsplat_suites program)
  cmake_parse_arguments(S "" "" "PROPERTIES;SLOW_PROPERTIES" ${ARGN})
  set(suites ${CMAKE_CURRENT_BINARY_DIR}/${program}_suites.cmake)
  add_custom_command(TARGET ${program} POST_BUILD VERBATIM BYPRODUCTS ${suites}
    COMMAND ${CMAKE_COMMAND} -DPROGRAM=$<TARGET_FILE:${program}> -DOUTPUT=${suites} -DCASES=${test_cases_dir}
      "-DPROPERTIES=${S_PROPERTIES}" "-DSLOW_PROPERTIES=${S_SLOW_PROPERTIES}"
      -P ${PROJECT_SOURCE_DIR}/tests/cmake/add_suites.cmake)
  # A program that is not built yet is a failing test, not a missing one.
  set(included ${CMAKE_CURRENT_BINARY_DIR}/${program}_included.cmake)
  file(WRITE ${included} "if(EXISTS \"${suites}\")\n  include(\"${suites}\")\nelse()\n  add_test(${program}_NOT_BUILT ${program}_NOT_BUILT)\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES ${included})
endfunction()
