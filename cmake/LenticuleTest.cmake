# SPDX-License-Identifier: Apache-2.0
# How test programs are compiled and run.

# lenticule_test_options(NAME): sets how much a test program is optimised: less than the libraries,
# because compiling a test takes longer than running its own code.
function(lenticule_test_options name)
  if(LENTICULE_CLANG_TESTS OR LENTICULE_BUILD_FUZZ)
    set_target_properties(${name} PROPERTIES LENTICULE_UNOPTIMISED ON)
    target_compile_options(${name} PRIVATE -O0)  # clang instruments unoptimised code in half the time
  else()
    # Three warnings of gcc are false at -O1: it inlines only one of an allocation and its release, and
    # misestimates the length of short strings.
    target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>
      $<$<CXX_COMPILER_ID:GNU>:-Wno-mismatched-new-delete;-Wno-array-bounds;-Wno-stringop-overflow>)
  endif()
endfunction()

# lenticule_use_clang(): compiles the C++ sources of this folder and of those below it with clang, whatever compiles
# the libraries. Unoptimised, clang takes a third of the time that gcc takes for a test program at -O1.
#
# CMake supports one compiler per language. But it reads the variables that describe the compiler in the
# folder of each target, so that another one can be described here, as project() does.
macro(lenticule_use_clang)
  find_program(LENTICULE_CLANG clang++ REQUIRED)
  execute_process(COMMAND ${LENTICULE_CLANG} -dumpversion
    OUTPUT_VARIABLE CMAKE_CXX_COMPILER_VERSION OUTPUT_STRIP_TRAILING_WHITESPACE
    COMMAND_ERROR_IS_FATAL ANY)
  set(CMAKE_CXX_COMPILER ${LENTICULE_CLANG})
  set(CMAKE_CXX_COMPILER_ID Clang)
  set(CMAKE_CXX_COMPILER_FRONTEND_VARIANT GNU)
  include(Compiler/Clang-CXX)
endmacro()

# lenticule_test(NAME KIND [FAST] [THREADED] [SLOW FILTER] [TIMEOUT SECONDS] SOURCES PATTERN ... DEPENDS ...
#                [RUNS TARGET ...])
#   One GoogleTest program; KIND (unit, property, golden, ...) becomes its CTest label.
#   FAST: the program takes seconds as a whole. It is one CTest entry, which saves a process per case,
#   with the label quick.
#   SLOW: a GoogleTest filter; its cases have the label slow and run in scripts/test --slow only; with
#   FAST they are one more entry, NAME.slow.
#   THREADED: worth running with the thread sanitizer: the label has the suffix -threaded.
#   RUNS: programs and libraries that the tests start or load; the macro TARGET, in upper case, has the path.
function(lenticule_test name kind)
  cmake_parse_arguments(TEST "FAST;THREADED" "SLOW;TIMEOUT" "SOURCES;DEPENDS;RUNS" ${ARGN})
  set(label ${kind})
  if(TEST_THREADED)
    set(label ${kind}-threaded)  # ctest -L matches parts: the label stands for both
  endif()
  if(NOT TEST_TIMEOUT)
    set(TEST_TIMEOUT 300)
  endif()
  math(EXPR slow_timeout "3 * ${TEST_TIMEOUT}")  # slow tests get the processor time that others leave
  lenticule_sources(sources ${TEST_SOURCES})
  add_executable(${name} ${sources})
  target_link_libraries(${name} PRIVATE lenticule_options ${TEST_DEPENDS} GTest::gmock_main)
  foreach(target IN LISTS TEST_RUNS)
    if(TARGET ${target})
      string(TOUPPER ${target} macro)
      add_dependencies(${name} ${target})
      target_compile_definitions(${name} PRIVATE ${macro}="$<TARGET_FILE:${target}>")
    endif()
  endforeach()
  lenticule_test_options(${name})
  target_precompile_headers(${name} REUSE_FROM lenticule_test_headers)
  lenticule_batches(${name} 30)
  target_compile_definitions(${name} PRIVATE
    LENTICULE_SOURCE_DIR="${PROJECT_SOURCE_DIR}" LENTICULE_BINARY_DIR="${PROJECT_BINARY_DIR}")
  set(skip SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
  if(TEST_FAST)
    add_test(NAME ${name} COMMAND ${name} --gtest_filter=-${TEST_SLOW})
    set_tests_properties(${name} PROPERTIES LABELS "${label};quick" TIMEOUT ${TEST_TIMEOUT} ${skip})
    if(TEST_SLOW)
      add_test(NAME ${name}.slow COMMAND ${name} --gtest_filter=${TEST_SLOW})
      set_tests_properties(${name}.slow PROPERTIES LABELS ${label}-slow TIMEOUT ${slow_timeout} ${skip})
    endif()
    return()
  endif()
  set(discovery DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60)
  gtest_discover_tests(${name} ${discovery} TEST_FILTER "-${TEST_SLOW}"
    PROPERTIES LABELS ${label} TIMEOUT ${TEST_TIMEOUT} ${skip})
  if(TEST_SLOW)
    gtest_discover_tests(${name} ${discovery} TEST_FILTER "${TEST_SLOW}"
      PROPERTIES LABELS ${label}-slow TIMEOUT ${slow_timeout} ${skip})
  endif()
endfunction()
