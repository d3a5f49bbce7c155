# SPDX-License-Identifier: Apache-2.0
# lenticule_fuzz(NAME SOURCES ... [WHOLE LIBRARY PARTS ...] DEPENDS ...)
#   Adds one libFuzzer target NAME_fuzz. Its seeds are tests/fuzz/corpus/NAME/*. Without libFuzzer the
#   same source is built with a plain main() that runs the seeds once, as an ordinary test.
#   PARTS: the sources of the library WHOLE that are under test; libFuzzer's build compiles only these.
set_property(GLOBAL PROPERTY LENTICULE_FUZZ_NAMES "")

function(lenticule_fuzz name)
  cmake_parse_arguments(FUZZ "" "" "SOURCES;WHOLE;PARTS;DEPENDS" ${ARGN})
  set(corpus ${PROJECT_SOURCE_DIR}/tests/fuzz/corpus/${name})
  set_property(GLOBAL APPEND PROPERTY LENTICULE_FUZZ_NAMES ${name})
  add_executable(${name}_fuzz ${FUZZ_SOURCES})
  target_link_libraries(${name}_fuzz PRIVATE lenticule_options ${FUZZ_DEPENDS})
  if(LENTICULE_BUILD_FUZZ)
    target_sources(${name}_fuzz PRIVATE ${FUZZ_PARTS})
    target_link_options(${name}_fuzz PRIVATE -fsanitize=fuzzer)
  else()
    lenticule_test_options(${name}_fuzz)
    if(NOT TARGET lenticule_fuzz_replay)
      add_library(lenticule_fuzz_replay OBJECT ${PROJECT_SOURCE_DIR}/tests/fuzz/replay_main.cpp)
      target_link_libraries(lenticule_fuzz_replay PRIVATE lenticule_options)
    endif()
    target_link_libraries(${name}_fuzz PRIVATE lenticule_fuzz_replay ${FUZZ_WHOLE})
    add_test(NAME fuzz.replay.${name} COMMAND ${name}_fuzz ${corpus})
    set_tests_properties(fuzz.replay.${name} PROPERTIES LABELS fuzz TIMEOUT 120)
  endif()
endfunction()
