# The operations again with both debugging checks after each launch (runtime/launch_checks.h). Tests that feed NaN on purpose, or measure
# the memory of inputs that were never written, are listed by name and run with red zones only. Tests that count bytes of memory, which red
# zones add to, are left out.
set(feeds_nan
  *.NonFiniteInputStaysInItsView/*
  *Adamw.NormShowsWhatIsNotFinite/*
  *Loss.NanStaysNan/*
  *ActivationTest.ReluKeepsWhatIsNoNumber/*
  *LpipsOps.ReluClampsAndKeepsWhatIsNoNumber/*
  *GemmMatrixTest.RoundsOperandsToNearestEven/*
  *GemmPairs.RoundOperandsToNearestEven/*
  *GemmBackward.PlanTakesTheSameMemory/*)
set(counts_bytes Context.ReusesMemoryAndReportsPeak)
list(JOIN feeds_nan ":" feeds_nan)
function(vsplat_debugging_tests name program variables filter)
  add_test(NAME ${name} COMMAND ${program} --gtest_brief=1 --gtest_filter=${filter})
  set_tests_properties(${name} PROPERTIES LABELS unit TIMEOUT 600 COST 100
    ENVIRONMENT "${variables};${sanitizer_environment}"
    SKIP_REGULAR_EXPRESSION "VSPLAT_ARENA=guard: PoCL [^ ]+ may end the process")
endfunction()
foreach(folder ops runtime)
  foreach(shard RANGE 3)  # all of ops takes longer than a test may on a busy machine
    vsplat_debugging_tests(${folder}.checked.${shard} ${folder}_tests
      "VSPLAT_CHECK=nan;VSPLAT_ARENA=guard;GTEST_TOTAL_SHARDS=4;GTEST_SHARD_INDEX=${shard}" "-${feeds_nan}:${counts_bytes}")
  endforeach()
  vsplat_debugging_tests(${folder}.guard ${folder}_tests VSPLAT_ARENA=guard "${feeds_nan}")
endforeach()
