# SPDX-License-Identifier: Apache-2.0
# Compiles many sources of a target as one, so that shared headers are read once. This takes a third of
# the work of a full build; an incremental build would compile more than changed.

# lenticule_batches(TARGET LONGEST): lets LENTICULE_BATCHES compile a target in batches of at most LONGEST sources.
# An optimised library has shorter ones, so that all cores are busy until the end.
function(lenticule_batches target longest)
  set_property(GLOBAL APPEND PROPERTY LENTICULE_BATCHED ${target})
  set_target_properties(${target} PROPERTIES LENTICULE_LONGEST_BATCH ${longest})
endfunction()

# lenticule_compile_in_batches(): applies to every such target defined so far. scripts/source_batches.py
# decides which sources can be combined, and writes the files that combine them.
function(lenticule_compile_in_batches)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  get_property(targets GLOBAL PROPERTY LENTICULE_BATCHED)
  set(questions "")
  foreach(target IN LISTS targets)
    get_target_property(longest ${target} LENTICULE_LONGEST_BATCH)
    get_target_property(folder ${target} SOURCE_DIR)
    get_target_property(sources ${target} SOURCES)
    string(APPEND questions "${target};${longest};${folder};${sources}\n")
  endforeach()
  set(batches ${PROJECT_BINARY_DIR}/batches)
  file(WRITE ${batches}.txt "${questions}")
  execute_process(
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/source_batches.py ${batches}
    INPUT_FILE ${batches}.txt OUTPUT_FILE ${batches}.cmake COMMAND_ERROR_IS_FATAL ANY)
  include(${batches}.cmake)
endfunction()
