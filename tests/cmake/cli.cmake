# Tests of the command line. COST: long tests begin first, so that no processor is idle at the end.
find_package(Python3 COMPONENTS Interpreter REQUIRED)
# Python exits with 0 even if it skips a test; the last line of its output shows that.
set(python_skipped "OK \\(skipped=")
foreach(part accidents bad_files bench cameras check convert dataset doctor driver_state evaluate far fit fit_page fit_scene flags full_disk genden help import kernels lara pictures precision profile reader refusal report run scene_formats scenes selftest share strangers tables train train_learns train_report tune usage viewer views)
  add_test(NAME cli_${part} COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/${part}_test.py)
  set_tests_properties(cli_${part} PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()

# The tests marked as slow in these files, which the tests above skip.
foreach(part bad_files import reader selftest share train train_learns tune viewer)
  add_test(NAME cli_${part}_slow COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/${part}_test.py --slow)
  set_tests_properties(cli_${part}_slow PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()

# Several processes: with the MPI module their results, without it that each process is refused.
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

# A window on a screen of the test's own.
if(TARGET window_example)
  set(window_environment "${sanitizer_environment}")
  if(VSPLAT_SANITIZE)  # SDL has unloaded its display drivers when leaks are searched, so their leaks cannot be attributed
    set(window_environment "ASAN_OPTIONS=intercept_tls_get_addr=0:detect_leaks=0")
  endif()
  add_test(NAME window_example COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/window_test.py)
  set_tests_properties(window_example PROPERTIES LABELS cli TIMEOUT ${test_seconds} SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_WINDOW=$<TARGET_FILE:window_example>;PYTHONDONTWRITEBYTECODE=1;${window_environment}")
else()
  vsplat_left_out("No SDL (Debian: libsdl2-dev): the example with a window is left out")
endif()


# The documents: targets of their links, README's size, and the existence of the options that they name.
add_test(NAME links COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/links_test.py)
set_tests_properties(links PROPERTIES LABELS unit TIMEOUT 120 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")

# The Python module, which loads the library (a sanitizer's would have to be loaded before Python).
if(NOT VSPLAT_SANITIZE)
  add_test(NAME python_module COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/vsplat_test.py)
  set_tests_properties(python_module PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  add_test(NAME python_scene_edit COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/scene_edit_test.py)
  set_tests_properties(python_scene_edit PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  add_test(NAME python_metrics COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/metrics_test.py)
  set_tests_properties(python_metrics PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  add_test(NAME python_dlpack COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/dlpack_test.py)
  set_tests_properties(python_dlpack PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  add_test(NAME python_scene_formats COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/scene_formats_test.py)
  set_tests_properties(python_scene_formats PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  # Calls every function of the public headers with mistakes that a caller may make.
  add_test(NAME functions COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/python/functions_test.py)
  set_tests_properties(functions PROPERTIES LABELS unit TIMEOUT 300 COST 100
    ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1")
  # The quick test does not complete the calls of some slow functions.
  add_test(NAME functions_whole COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/python/functions_test.py)
  set_tests_properties(functions_whole PROPERTIES LABELS "unit;slow" TIMEOUT 1500
    ENVIRONMENT "VSPLAT_FUNCTIONS=whole;VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>;PYTHONDONTWRITEBYTECODE=1")
  # The binary interface, which programs linked with an earlier version rely on.
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
add_test(NAME stems COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/stems_test.py)
set_tests_properties(pairs stems PROPERTIES LABELS unit TIMEOUT 60 ENVIRONMENT "PYTHONDONTWRITEBYTECODE=1")

# Plain words, and allowed includes.
add_test(NAME words COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/.ci/check-words)
add_test(NAME layers COMMAND Python3::Interpreter ${PROJECT_SOURCE_DIR}/.ci/check-layers)
set_tests_properties(words layers PROPERTIES LABELS unit TIMEOUT 60)

# Checks the numbers of an evaluation with the PyTorch specification, if PyTorch is installed.
add_test(NAME evaluate_numbers COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh check_evaluate.py)
set_tests_properties(evaluate_numbers PROPERTIES LABELS cli TIMEOUT 600 COST 200 SKIP_RETURN_CODE 77
  ENVIRONMENT "OMP_NUM_THREADS=1;VSPLAT=$<TARGET_FILE:vsplat_cli>;${sanitizer_environment}")

# Files made to break their reader, and which files are opened. Quick: some of one seed's files; slow: all files of three seeds.
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
# Damaged and malicious checkpoints. Quick (cli_import): some for each sound checkpoint; slow: all 300.
add_test(NAME cli_import_mutations
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/import_test.py Hostile HostileLara HostileGenden HostileDinov3)
set_tests_properties(cli_import_mutations PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds} SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_MUTATIONS=all;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
add_test(NAME cli_fit_kills
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/fit_test.py Fit.test_killed_at_any_moment)
set_tests_properties(cli_fit_kills PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds}
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_KILLS=20;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
add_test(NAME cli_train_kills
  COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/train_test.py Train.test_killed_at_any_moment)
set_tests_properties(cli_train_kills PROPERTIES LABELS "cli;slow" TIMEOUT ${test_seconds}
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_KILLS=20;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")

# Training on another machine. Quick: the script with a stand-in for vsplat. Slow: twice with the real one, and the bundle for that machine,
# which needs a build without sanitizers.
add_test(NAME cli_gpu_script COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_script_test.py StandIn)
add_test(NAME cli_gpu_script_trains COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_script_test.py GpuScript)
set_tests_properties(cli_gpu_script cli_gpu_script_trains PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_BUNDLE=$<IF:$<BOOL:${VSPLAT_SANITIZE}>,,${PROJECT_BINARY_DIR}>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
set_tests_properties(cli_gpu_script_trains PROPERTIES LABELS "cli;slow" TIMEOUT 1800)
# The same for the first hour on a GPU.
add_test(NAME cli_gpu_first_hour COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_first_hour_test.py StandIn)
add_test(NAME cli_gpu_first_hour_runs COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/gpu_first_hour_test.py FirstHour)
set_tests_properties(cli_gpu_first_hour cli_gpu_first_hour_runs PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100
  SKIP_REGULAR_EXPRESSION "${python_skipped}"
  ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;VSPLAT_BUNDLE=$<IF:$<BOOL:${VSPLAT_SANITIZE}>,,${PROJECT_BINARY_DIR}>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
set_tests_properties(cli_gpu_first_hour_runs PROPERTIES LABELS "cli;slow" TIMEOUT 3600)
