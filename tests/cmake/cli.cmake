# The command line, from outside. COST: what takes long is begun first, so that a processor does not wait at the end.
find_package(Python3 COMPONENTS Interpreter REQUIRED)
# Python ends well where it skips a test; its last line tells.
set(python_skipped "OK \\(skipped=")
foreach(part accidents bad_files bench cameras check convert dataset doctor driver_state evaluate far flags full_disk genden help import kernels lara pictures precision profile reader refine refusal report run selftest share strangers tables train train_learns train_report tune usage views)
  add_test(NAME cli_${part} COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/${part}_test.py)
  set_tests_properties(cli_${part} PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()

# The tests marked as slow in these files, which the tests above omit.
foreach(part bad_files import reader selftest share train train_learns tune)
  add_test(NAME cli_${part}_slow COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/${part}_test.py --slow)
  set_tests_properties(cli_${part}_slow PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()

# Several processes: with the module for MPI what they do together, without it that each is refused.
if(TARGET vsplat_mpi)
  set(ranks_part Ranks)
  set(ranks_module "$<TARGET_FILE:vsplat_mpi>")
  if(VSPLAT_REQUIRE_ALL_TESTS)
    find_program(MPIRUN mpirun REQUIRED)
  endif()
else()
  set(ranks_part WithoutMpi)
  set(ranks_module "")
endif()
set(ranks_tests cli_ranks)
add_test(NAME cli_ranks COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/ranks_test.py ${ranks_part})
if(TARGET vsplat_mpi)
  list(APPEND ranks_tests cli_ranks_slow)
  add_test(NAME cli_ranks_slow COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/ranks_test.py ${ranks_part} --slow)
endif()
set_tests_properties(${ranks_tests} PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_MPI_MODULE=${ranks_module};PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
if(TARGET vsplat_mpi)
  set_tests_properties(cli_ranks_slow PROPERTIES LABELS "cli;slow")
endif()

# A window, on a screen of the test's own.
if(TARGET window_example)
  set(window_environment "${sanitizer_environment}")
  if(VSPLAT_SANITIZE)  # SDL has unloaded its drivers of a screen when leaks are looked for: whose they are is not known any more
    set(window_environment "ASAN_OPTIONS=intercept_tls_get_addr=0:detect_leaks=0")
  endif()
  add_test(NAME window_example COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/window_test.py)
  set_tests_properties(window_example PROPERTIES LABELS cli TIMEOUT ${test_seconds} SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_WINDOW=$<TARGET_FILE:window_example>;PYTHONDONTWRITEBYTECODE=1;${window_environment}")
else()
  vsplat_left_out("No SDL (Debian: libsdl2-dev): the example with a window is left out")
endif()


# The documents: where their links lead, README's size, and that the options which they name exist.
add_test(NAME links COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/links_test.py)
set_tests_properties(links PROPERTIES LABELS unit TIMEOUT 120 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")

# The Python module, which loads the library (a sanitizer's would have to be loaded before Python).
if(NOT VSPLAT_SANITIZE)
  add_test(NAME python_module COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/vsplat_test.py)
  set_tests_properties(python_module PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  add_test(NAME python_dlpack COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/dlpack_test.py)
  set_tests_properties(python_dlpack PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  # Every function of the public headers, with what a caller may get wrong.
  add_test(NAME functions COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/python/functions_test.py)
  set_tests_properties(functions PROPERTIES LABELS unit TIMEOUT 300 COST 100
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1")
  # The quick test does not complete the calls of some slow functions.
  add_test(NAME functions_whole COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/python/functions_test.py)
  set_tests_properties(functions_whole PROPERTIES LABELS "unit;slow" TIMEOUT 1500
    ENVIRONMENT "VSPLAT_FUNCTIONS=whole;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1")
  # What programs that were linked before rely on.
  add_test(NAME abi COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/python/abi_test.py)
  set_tests_properties(abi PROPERTIES LABELS unit TIMEOUT 60
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1")
endif()

# The mean of models, with numpy.
add_test(NAME cli_weights_scripts COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../cli/weights_scripts_test.py)
set_tests_properties(cli_weights_scripts PROPERTIES LABELS cli TIMEOUT ${test_seconds} SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")

# Operations: a forward for every backward, and files of one stem.
add_test(NAME pairs COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/pairs_test.py)
set_tests_properties(pairs PROPERTIES LABELS unit TIMEOUT 60 ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")

# Plain words, and what each folder may include.
add_test(NAME words COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/.ci/check-words)
add_test(NAME layers COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/.ci/check-layers)
set_tests_properties(words layers PROPERTIES LABELS unit TIMEOUT 60)

# The numbers of an evaluation, by the PyTorch specification where PyTorch is there.
add_test(NAME evaluate_numbers COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh check_evaluate.py)
set_tests_properties(evaluate_numbers PROPERTIES LABELS cli TIMEOUT 600 COST 200 SKIP_RETURN_CODE 77
  ENVIRONMENT "OMP_NUM_THREADS=1;VSPLAT=$<TARGET_FILE:vsplat_cli>;${sanitizer_environment}")

# Files that are made to break their reader. Quick: one seed, and of its files some; slow: all of three seeds. And what is opened meanwhile.
foreach(part hostile hostile_seeds hostile_traced)
  add_test(NAME cli_${part} COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/hostile_test.py
    $<IF:$<STREQUAL:${part},hostile_traced>,Traced,Hostile>)
  set_tests_properties(cli_${part} PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()
set_tests_properties(cli_hostile_seeds PROPERTIES LABELS "cli;slow" TIMEOUT 7200
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_HOSTILE_SEEDS=1,2,3;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
set_tests_properties(cli_hostile_traced PROPERTIES LABELS "cli;slow" TIMEOUT 1800)

add_test(NAME cli_model COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/model_test.py)
set_tests_properties(cli_model PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_MICRO=${micro};VSPLAT_WITH_MODEL=${variants}/micro;VSPLAT_WITHOUT_MODEL=${variants}/none;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
# Checkpoints that are damaged or meant to break their reader. Quick (cli_import): some of those made of each sound one; slow: all 300.
add_test(NAME cli_import_mutations
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/import_test.py Hostile HostileLara HostileGenden HostileDinov3)
set_tests_properties(cli_import_mutations PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds} SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_MUTATIONS=all;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
add_test(NAME cli_refine_kills
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/refine_test.py Refine.test_killed_at_any_moment)
set_tests_properties(cli_refine_kills PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds}
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_KILLS=20;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
add_test(NAME cli_train_kills
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/train_test.py Train.test_killed_at_any_moment)
set_tests_properties(cli_train_kills PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds}
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_KILLS=20;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")

# A training on another machine. Quick: the script with a program in place of vsplat; slow: with it, twice, and what is packed for that machine,
# which is of a build without sanitizers.
add_test(NAME cli_gpu_script COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_script_test.py StandIn)
add_test(NAME cli_gpu_script_trains COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_script_test.py GpuScript)
set_tests_properties(cli_gpu_script cli_gpu_script_trains PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_BUNDLE=$<IF:$<BOOL:${VSPLAT_SANITIZE}>,,${PROJECT_BINARY_DIR}>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
set_tests_properties(cli_gpu_script_trains PROPERTIES LABELS "cli;slow" TIMEOUT 1800)
# The same of what a GPU is asked first.
add_test(NAME cli_gpu_first_hour COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_first_hour_test.py StandIn)
add_test(NAME cli_gpu_first_hour_runs COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_first_hour_test.py FirstHour)
set_tests_properties(cli_gpu_first_hour cli_gpu_first_hour_runs PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100
  SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_BUNDLE=$<IF:$<BOOL:${VSPLAT_SANITIZE}>,,${PROJECT_BINARY_DIR}>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
set_tests_properties(cli_gpu_first_hour_runs PROPERTIES LABELS "cli;slow" TIMEOUT 3600)
