# SPDX-License-Identifier: Apache-2.0
# lenticule_sources(RESULT PATTERN ... [EXCEPT FILE ...])
#   Lists sources relative to the current folder. A pattern with a star stands for the files of its folder
#   and those below it that no earlier target of the same CMakeLists.txt has, without main.cpp and kernels
#   (*_kernel.cpp). The next build finds a new file.
function(lenticule_sources result)
  cmake_parse_arguments(SOURCES "" "" "EXCEPT" ${ARGN})
  set(named ${SOURCES_UNPARSED_ARGUMENTS})
  set(patterns ${named})
  list(FILTER named EXCLUDE REGEX "\\*")
  list(FILTER patterns INCLUDE REGEX "\\*")
  set(found "")
  if(patterns)
    file(GLOB_RECURSE found CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} ${patterns})
    list(FILTER found EXCLUDE REGEX "(_kernel|^main)\\.cpp$")
    get_property(taken DIRECTORY PROPERTY LENTICULE_TAKEN)
    list(REMOVE_ITEM found ${taken} ${named} ${SOURCES_EXCEPT})
  endif()
  list(APPEND found ${named})
  set_property(DIRECTORY APPEND PROPERTY LENTICULE_TAKEN ${found})
  set(${result} ${found} PARENT_SCOPE)
endfunction()

# lenticule_library(NAME [LIGHT] [SOURCES PATTERN ...] [EXCEPT FILE ...] [DEPENDS ...] [PRIVATE_DEPENDS ...])
#   Adds the static library lenticule_NAME (alias lenticule::NAME) of the current folder.
#   LIGHT: the library does not compute much; -O1 and precompiled headers save a fifth of its build time.
function(lenticule_library name)
  cmake_parse_arguments(LIBRARY "LIGHT" "" "SOURCES;EXCEPT;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  if(NOT LIBRARY_SOURCES)
    set(LIBRARY_SOURCES *.cpp)
  endif()
  lenticule_sources(sources ${LIBRARY_SOURCES} EXCEPT ${LIBRARY_EXCEPT})
  add_library(lenticule_${name} STATIC ${sources})
  add_library(lenticule::${name} ALIAS lenticule_${name})
  target_link_libraries(lenticule_${name}
    PUBLIC lenticule_options ${LIBRARY_DEPENDS}
    PRIVATE ${LIBRARY_PRIVATE_DEPENDS})
  if(LIBRARY_LIGHT)
    lenticule_heavy_headers(lenticule_${name})
    # Most of the time goes into templates of these headers, once for each batch.
    set_target_properties(lenticule_${name} PROPERTIES LENTICULE_LONGEST_BATCH 30)
  endif()
endfunction()

# lenticule_program(NAME COMPONENT [DEPENDS ...] [SOURCES PATTERN ...])
#   Adds the program lenticule-NAME (target lenticule_NAME_program) of main.cpp and the sources. It is built
#   beside lenticule, and installed into the folder for helper programs.
function(lenticule_program name component)
  cmake_parse_arguments(PROGRAM "" "" "SOURCES;DEPENDS" ${ARGN})
  lenticule_sources(sources main.cpp ${PROGRAM_SOURCES})
  add_executable(lenticule_${name}_program ${sources})
  set_target_properties(lenticule_${name}_program PROPERTIES
    OUTPUT_NAME lenticule-${name} RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}
    INSTALL_RPATH $ORIGIN/../../${LENTICULE_INSTALL_MODULE_FOLDER})
  target_link_libraries(lenticule_${name}_program PRIVATE ${PROGRAM_DEPENDS})
  install(TARGETS lenticule_${name}_program
    RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/lenticule COMPONENT ${component})
endfunction()

# lenticule_isa_variants(NAME KERNEL.cpp ... [AVX512 FLAG ...])
#   Compiles kernel sources once per instruction set into the library NAME, for AVX-512 with the
#   flags: extensions which the code that selects the variant must ask for. The source puts its
#   functions into `namespace LENTICULE_ISA_NAMESPACE` (isa_baseline, isa_avx2, isa_avx512, isa_neon) and must
#   include nothing that defines non-inline or inline functions shared with other files, so that the
#   linker cannot choose an AVX-512 copy of a shared inline function.
#   base/cpu.h declares the variants and selects among them at run time.
function(lenticule_isa_variants name)
  cmake_parse_arguments(KERNELS "" "" "AVX512" ${ARGN})
  set(variants baseline)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    list(APPEND variants avx2 avx512)
  elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    list(APPEND variants neon)
  endif()
  set(flags_baseline "")
  set(flags_avx2 -mavx2 -mbmi2)
  set(flags_neon -DLENTICULE_NEON)  # every processor has NEON; only this variant uses its intrinsics
  set(flags_avx512 -mavx512f -mavx512dq -mavx512bw -mavx512vl -mprefer-vector-width=512 ${KERNELS_AVX512})
  foreach(kernel IN LISTS KERNELS_UNPARSED_ARGUMENTS)
    get_filename_component(stem ${kernel} NAME_WE)
    foreach(variant IN LISTS variants)
      set(object lenticule_${name}_${stem}_${variant})
      add_library(${object} OBJECT ${kernel})
      target_link_libraries(${object} PRIVATE lenticule_options)
      target_compile_options(${object} PRIVATE
        ${LENTICULE_KERNEL_OPTIMISATION} -Wno-psabi ${flags_${variant}})
      target_compile_definitions(${object} PRIVATE LENTICULE_ISA_NAMESPACE=isa_${variant})
      target_sources(lenticule_${name} PRIVATE $<TARGET_OBJECTS:${object}>)
    endforeach()
  endforeach()
endfunction()

# lenticule_heavy_headers(NAME): compiles a target with -O1, and with the headers that take most of the compile
# time of the sources that include them, precompiled once for all such targets.
function(lenticule_heavy_headers name)
  if(NOT TARGET lenticule_heavy_headers)
    set(source ${PROJECT_BINARY_DIR}/heavy_headers.cpp)
    if(NOT EXISTS ${source})
      file(WRITE ${source} "// Carries the precompiled headers.\n")
    endif()
    add_library(lenticule_heavy_headers OBJECT ${source})
    target_link_libraries(lenticule_heavy_headers PRIVATE
      lenticule_options CLI11::CLI11 fmt::fmt nlohmann_json::nlohmann_json)
    target_compile_options(lenticule_heavy_headers PRIVATE $<$<CONFIG:Release>:-O1>)
    target_precompile_headers(lenticule_heavy_headers PRIVATE
      <CLI/CLI.hpp> <fmt/format.h> <nlohmann/json.hpp>)
  endif()
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>)
  target_precompile_headers(${name} REUSE_FROM lenticule_heavy_headers)
endfunction()

# lenticule_test_options(NAME): sets how much a test program is optimised: less than the libraries,
# because compiling a test takes longer than running its own code.
function(lenticule_test_options name)
  if(LENTICULE_CLANG_TESTS)
    set_target_properties(${name} PROPERTIES LENTICULE_UNOPTIMISED ON)
    target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O0>)
    return()
  endif()
  if(LENTICULE_BUILD_FUZZ)
    set_target_properties(${name} PROPERTIES LENTICULE_UNOPTIMISED ON)
    target_compile_options(${name} PRIVATE -O0)  # clang instruments unoptimised code in half the time
    return()
  endif()
  # Three warnings of gcc are false at -O1: it inlines only one of an allocation and its release, and
  # misestimates the length of short strings.
  target_compile_options(${name} PRIVATE $<$<CONFIG:Release>:-O1>
    $<$<CXX_COMPILER_ID:GNU>:-Wno-mismatched-new-delete;-Wno-array-bounds;-Wno-stringop-overflow>)
endfunction()

# GoogleTest's headers and those of JSON take most of the time of compiling a test, so they are
# precompiled once for all test programs.
function(lenticule_test_headers name)
  lenticule_test_options(${name})
  if(NOT TARGET lenticule_test_headers)
    set(source ${PROJECT_BINARY_DIR}/test_headers.cpp)
    if(NOT EXISTS ${source})
      file(WRITE ${source} "// Carries the precompiled headers.\n")
    endif()
    add_library(lenticule_test_headers OBJECT ${source})
    target_link_libraries(lenticule_test_headers PRIVATE
      lenticule_options GTest::gmock fmt::fmt nlohmann_json::nlohmann_json)
    lenticule_test_options(lenticule_test_headers)
    target_compile_options(lenticule_test_headers PRIVATE -fPIE)
    target_compile_definitions(lenticule_test_headers PRIVATE
      LENTICULE_SOURCE_DIR="${PROJECT_SOURCE_DIR}" LENTICULE_BINARY_DIR="${PROJECT_BINARY_DIR}")
    target_precompile_headers(lenticule_test_headers PRIVATE
      <fmt/format.h> <gmock/gmock.h> <gtest/gtest.h> <nlohmann/json.hpp>
      <filesystem> <fstream> <thread>)
  endif()
  target_precompile_headers(${name} REUSE_FROM lenticule_test_headers)
endfunction()

# lenticule_test(NAME KIND [FAST] [THREADED] [SLOW FILTER] [TIMEOUT SECONDS] SOURCES PATTERN ... DEPENDS ...
#                [RUNS TARGET ...])
#   One GoogleTest program; KIND (unit, property, golden, ...) becomes its CTest label.
#   FAST: the program takes seconds as a whole. It is one CTest entry, which saves a process per case,
#   with the label quick.
#   SLOW: a GoogleTest filter; its cases have the label slow and run in scripts/test --slow only; with
#   FAST they are one more entry, NAME.slow.
#   THREADED: the program is run under the thread sanitizer, too.
#   RUNS: programs and libraries that the tests start or load; the macro TARGET, in upper case, has the path.
function(lenticule_test name kind)
  cmake_parse_arguments(TEST "FAST;THREADED" "SLOW;TIMEOUT" "SOURCES;DEPENDS;RUNS" ${ARGN})
  set(label ${kind})
  if(TEST_THREADED)
    set(label ${kind}-threaded)  # ctest -L matches parts: the label stands for both
    set_property(GLOBAL APPEND PROPERTY LENTICULE_THREADED_TESTS ${name})
  endif()
  if(NOT TEST_TIMEOUT)
    set(TEST_TIMEOUT 300)
  endif()
  math(EXPR slow_timeout "3 * ${TEST_TIMEOUT}")  # slow tests get the processor time that others leave
  if(kind STREQUAL unit)
    set_property(GLOBAL APPEND PROPERTY LENTICULE_UNIT_TESTS ${name})
  endif()
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
  lenticule_test_headers(${name})
  target_compile_definitions(${name} PRIVATE
    LENTICULE_SOURCE_DIR="${PROJECT_SOURCE_DIR}" LENTICULE_BINARY_DIR="${PROJECT_BINARY_DIR}")
  set(skipped "\\[  SKIPPED \\]")
  if(TEST_FAST)
    add_test(NAME ${name} COMMAND ${name} --gtest_filter=-${TEST_SLOW})
    set_tests_properties(${name} PROPERTIES LABELS "${label};quick" TIMEOUT ${TEST_TIMEOUT}
      SKIP_REGULAR_EXPRESSION "${skipped}")
    if(TEST_SLOW)
      add_test(NAME ${name}.slow COMMAND ${name} --gtest_filter=${TEST_SLOW})
      set_tests_properties(${name}.slow PROPERTIES LABELS ${label}-slow TIMEOUT ${slow_timeout}
        SKIP_REGULAR_EXPRESSION "${skipped}")
    endif()
    return()
  endif()
  set(discovery DISCOVERY_MODE PRE_TEST DISCOVERY_TIMEOUT 60)
  gtest_discover_tests(${name} ${discovery} TEST_FILTER "-${TEST_SLOW}"
    PROPERTIES LABELS ${label} TIMEOUT ${TEST_TIMEOUT} SKIP_REGULAR_EXPRESSION "${skipped}")
  if(TEST_SLOW)
    gtest_discover_tests(${name} ${discovery} TEST_FILTER "${TEST_SLOW}"
      PROPERTIES LABELS ${label}-slow TIMEOUT ${slow_timeout}
      SKIP_REGULAR_EXPRESSION "${skipped}")
  endif()
endfunction()
