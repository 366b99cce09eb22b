# The operations once more with what debugging looks at after each launch (runtime/launch_checks.h), both aids at once.
# With red zones alone, by name: what feeds NaN on purpose, to see where it goes, or inputs that were never written, to
# see its memory alone. Left out: what counts bytes of memory that red zones add to.
set(feeds_nan
  *.NonFiniteInputStaysInItsView/*
  *Adamw.NormShowsWhatIsNotFinite/*
  *Loss.NanStaysNan/*
  *ActivationTest.ReluKeepsWhatIsNoNumber/*
  *LpipsOps.ReluClampsAndKeepsWhatIsNoNumber/*
  *GemmMatrixTest.RoundsOperandsToNearestEven/*
  *GemmBackward.PlanTakesTheSameMemory/*)
set(counts_bytes Context.ReusesMemoryAndReportsPeak)
list(JOIN feeds_nan ":" feeds_nan)
function(vsplat_debugging_tests name program variables filter)
  add_test(NAME ${name} COMMAND ${program} --gtest_brief=1 --gtest_filter=${filter})
  set_tests_properties(${name} PROPERTIES LABELS unit TIMEOUT 600 COST 100
    ENVIRONMENT "${variables};${sanitizer_environment}")
endfunction()
foreach(folder ops runtime)
  vsplat_debugging_tests(${folder}.checked ${folder}_tests "VSPLAT_CHECK=nan;VSPLAT_ARENA=guard"
    "-${feeds_nan}:${counts_bytes}")
  vsplat_debugging_tests(${folder}.guard ${folder}_tests VSPLAT_ARENA=guard "${feeds_nan}")
endforeach()
