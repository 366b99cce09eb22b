# The operations once more with what debugging looks at after each launch (runtime/launch_checks.h). Left out, by name:
# what feeds NaN on purpose, to see where it goes, or inputs that were never written, to see its memory alone; and what
# counts bytes of memory that red zones add to.
set(feeds_nan
  *.NonFiniteInputStaysInItsView/*
  *Adamw.NormShowsWhatIsNotFinite/*
  *Loss.NanStaysNan/*
  *ActivationTest.ReluKeepsWhatIsNoNumber/*
  *LpipsOps.ReluClampsAndKeepsWhatIsNoNumber/*
  *GemmBackward.PlanTakesTheSameMemory/*)
set(counts_bytes Context.ReusesMemoryAndReportsPeak)
function(vsplat_debugging_tests program variable)
  cmake_parse_arguments(T "" "NAME" "EXCEPT" ${ARGN})
  list(JOIN T_EXCEPT ":" except)
  add_test(NAME ${T_NAME} COMMAND ${program} --gtest_brief=1 --gtest_filter=-${except})
  set_tests_properties(${T_NAME} PROPERTIES LABELS unit TIMEOUT 600 COST 100 ENVIRONMENT "${variable};${sanitizer_environment}")
endfunction()
vsplat_debugging_tests(ops_tests VSPLAT_CHECK=nan NAME ops.nan EXCEPT ${feeds_nan})
vsplat_debugging_tests(ops_tests VSPLAT_ARENA=guard NAME ops.guard EXCEPT ${counts_bytes})
vsplat_debugging_tests(runtime_tests VSPLAT_CHECK=nan NAME runtime.nan EXCEPT ${feeds_nan})
vsplat_debugging_tests(runtime_tests VSPLAT_ARENA=guard NAME runtime.guard EXCEPT ${counts_bytes})
