# Tests of the command line. COST: long tests begin first, so that no processor is idle at the end.
find_package(Python3 COMPONENTS Interpreter REQUIRED)
# Python exits with 0 even if it skips a test; the last line of its output shows that.
set(python_skipped "OK \\(skipped=")

# vsplat_script_test(NAME SCRIPT arguments... LABELS ... [TIMEOUT seconds] [PROPERTIES ...] [ENVIRONMENT ...]): a script of this folder, which
# finds the command in $VSPLAT.
function(vsplat_script_test name script)
  cmake_parse_arguments(T "" "TIMEOUT" "LABELS;PROPERTIES;ENVIRONMENT" ${ARGN})
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT ${test_seconds})
  endif()
  add_test(NAME ${name} COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/${script} ${T_UNPARSED_ARGUMENTS})
  set_tests_properties(${name} PROPERTIES LABELS "${T_LABELS}" TIMEOUT ${T_TIMEOUT} SKIP_REGULAR_EXPRESSION "${python_skipped}" ${T_PROPERTIES}
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${T_ENVIRONMENT};${sanitizer_environment}")
endfunction()
# The same for one that runs long, so that it begins early.
function(vsplat_cli_test name script)
  vsplat_script_test(${name} cli/${script} ${ARGN} PROPERTIES COST 100)
endfunction()
set(with_library ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")

foreach(part accidents bad_files bench cameras check convert dataset doctor driver_state evaluate far fit fit_page fit_scene flags full_disk genden help import kernels lara live mesh pictures precision profile reader refusal report run scene_formats scenes selftest share strangers tables train train_learns train_report tune usage viewer views)
  vsplat_cli_test(cli_${part} ${part}_test.py LABELS cli ${with_library})
endforeach()
# The tests marked as slow in these files, which the tests above skip.
foreach(part bad_files import live precision reader selftest share train train_learns tune viewer)
  vsplat_cli_test(cli_${part}_slow ${part}_test.py --slow LABELS cli slow ${with_library})
endforeach()

# Cameras of bare photographs: with programs in place of COLMAP, and with COLMAP itself.
foreach(part "cli_poses;StandIn" "cli_poses_colmap;Colmap")
  list(GET part 0 name)
  list(GET part 1 class)
  add_test(NAME ${name} COMMAND Python3::Interpreter ${CMAKE_CURRENT_SOURCE_DIR}/cli/poses_test.py ${class})
  set_tests_properties(${name} PROPERTIES LABELS cli TIMEOUT ${test_seconds} COST 100 SKIP_REGULAR_EXPRESSION "${python_skipped}"
    ENVIRONMENT "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${sanitizer_environment}")
endforeach()

# Several processes: with the MPI module their results, without it that each process is refused.
if(TARGET vsplat_mpi)
  if(VSPLAT_REQUIRE_ALL_TESTS)
    find_program(MPIRUN mpirun REQUIRED)
  endif()
  set(with_mpi ENVIRONMENT "VSPLAT_MPI_MODULE=$<TARGET_FILE:vsplat_mpi>")
  vsplat_cli_test(cli_ranks ranks_test.py Ranks LABELS cli ${with_mpi})
  vsplat_cli_test(cli_ranks_slow ranks_test.py Ranks --slow LABELS cli slow ${with_mpi})
else()
  vsplat_cli_test(cli_ranks ranks_test.py WithoutMpi LABELS cli ENVIRONMENT VSPLAT_MPI_MODULE=)
endif()

# A window on a screen of the test's own.
if(TARGET window_example)
  set(in_window VSPLAT_WINDOW=$<TARGET_FILE:window_example>)
  vsplat_script_test(window_example cli/window_test.py LABELS cli ENVIRONMENT ${in_window})
  if(VSPLAT_SANITIZE)  # SDL has unloaded its display drivers when leaks are searched, so their leaks cannot be attributed
    set_tests_properties(window_example PROPERTIES ENVIRONMENT
      "VSPLAT=$<TARGET_FILE:vsplat_cli>;PYTHONDONTWRITEBYTECODE=1;${in_window};ASAN_OPTIONS=intercept_tls_get_addr=0:detect_leaks=0")
  endif()
else()
  vsplat_left_out("No SDL (Debian: libsdl2-dev): the example with a window is left out")
endif()

# The documents: targets of their links, README's size, and the existence of the options that they name.
vsplat_script_test(links links_test.py LABELS unit TIMEOUT 120)

# The Python module, which loads the library (a sanitizer's would have to be loaded before Python).
if(NOT VSPLAT_SANITIZE)
  foreach(part vsplat scene_edit metrics dlpack scene_formats)
    string(REPLACE vsplat module name ${part})
    add_test(NAME python_${name} COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/reference/pytorch/run.sh ../../python/${part}_test.py)
    set_tests_properties(python_${name} PROPERTIES LABELS cli TIMEOUT 300 SKIP_RETURN_CODE 77 SKIP_REGULAR_EXPRESSION "${python_skipped}"
      ENVIRONMENT "VSPLAT_LIBRARY=$<TARGET_FILE:vsplat>")
  endforeach()
  # Calls every function of the public headers with mistakes that a caller may make.
  vsplat_script_test(functions python/functions_test.py LABELS unit TIMEOUT 300 PROPERTIES COST 100 ${with_library})
  # The quick test does not complete the calls of some slow functions.
  vsplat_script_test(functions_whole python/functions_test.py LABELS unit slow TIMEOUT 1500 ${with_library} VSPLAT_FUNCTIONS=whole)
  # The binary interface, which programs linked with an earlier version rely on.
  vsplat_script_test(abi python/abi_test.py LABELS unit TIMEOUT 60 ${with_library})
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
vsplat_cli_test(cli_hostile hostile_test.py Hostile LABELS cli)
vsplat_cli_test(cli_hostile_seeds hostile_test.py Hostile LABELS cli slow TIMEOUT 7200 ENVIRONMENT VSPLAT_HOSTILE_SEEDS=1,2,3)
vsplat_cli_test(cli_hostile_traced hostile_test.py Traced LABELS cli slow TIMEOUT 1800)

vsplat_cli_test(cli_model model_test.py LABELS cli
  ENVIRONMENT VSPLAT_MICRO=${micro} VSPLAT_WITH_MODEL=${variants}/micro VSPLAT_WITHOUT_MODEL=${variants}/none)
# Damaged and malicious checkpoints. Quick (cli_import): some for each sound checkpoint; slow: all 300.
vsplat_script_test(cli_import_mutations cli/import_test.py Hostile HostileLara HostileGenden HostileDinov3 LABELS cli slow
  ENVIRONMENT VSPLAT_MUTATIONS=all)
vsplat_script_test(cli_fit_kills cli/fit_test.py Fit.test_killed_at_any_moment LABELS cli slow ENVIRONMENT VSPLAT_KILLS=20)
vsplat_script_test(cli_train_kills cli/train_test.py Train.test_killed_at_any_moment LABELS cli slow ENVIRONMENT VSPLAT_KILLS=20)

# Training on another machine. Quick: the script with a stand-in for vsplat. Slow: twice with the real one, and the bundle for that machine,
# which needs a build without sanitizers. Then the same for the first hour on a GPU.
set(with_bundle ENVIRONMENT VSPLAT_BUNDLE=$<IF:$<BOOL:${VSPLAT_SANITIZE}>,,${PROJECT_BINARY_DIR}>)
vsplat_cli_test(cli_gpu_script gpu_script_test.py StandIn LABELS cli ${with_bundle})
vsplat_cli_test(cli_gpu_script_trains gpu_script_test.py GpuScript LABELS cli slow TIMEOUT 1800 ${with_bundle})
vsplat_cli_test(cli_gpu_first_hour gpu_first_hour_test.py StandIn LABELS cli ${with_bundle})
vsplat_cli_test(cli_gpu_first_hour_runs gpu_first_hour_test.py FirstHour LABELS cli slow TIMEOUT 3600 ${with_bundle})
