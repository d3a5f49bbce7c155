# SPDX-License-Identifier: Apache-2.0
# Compiles many sources of a target as one, so that shared headers are read once. This takes a third of
# the work of a full build; an incremental build would compile more than changed.

# lenticule_targets(RESULT FOLDER): lists the targets of a folder and its sub-folders.
function(lenticule_targets result folder)
  get_property(targets DIRECTORY ${folder} PROPERTY BUILDSYSTEM_TARGETS)
  get_property(folders DIRECTORY ${folder} PROPERTY SUBDIRECTORIES)
  foreach(below IN LISTS folders)
    lenticule_targets(more ${below})
    list(APPEND targets ${more})
  endforeach()
  set(${result} ${targets} PARENT_SCOPE)
endfunction()

# lenticule_cpp_sources(RESULT TARGET): lists the absolute paths of the C++ sources in the source tree
# that are compiled with the options of their target.
function(lenticule_cpp_sources result target)
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  list(FILTER sources INCLUDE REGEX "^[^$<>]*\\.cpp$")
  list(TRANSFORM sources PREPEND ${folder}/ REGEX "^[^/]")
  list(FILTER sources INCLUDE REGEX "^${PROJECT_SOURCE_DIR}/")
  list(FILTER sources EXCLUDE REGEX "^${PROJECT_BINARY_DIR}/")
  set(alike "")
  foreach(source IN LISTS sources)
    get_source_file_property(options ${source} TARGET_DIRECTORY ${target} COMPILE_OPTIONS)
    get_source_file_property(definitions ${source} TARGET_DIRECTORY ${target} COMPILE_DEFINITIONS)
    if(NOT options AND NOT definitions)
      list(APPEND alike ${source})
    endif()
  endforeach()
  set(${result} ${alike} PARENT_SCOPE)
endfunction()

# lenticule_longest_batch(RESULT TARGET): sets the largest number of sources of a batch: the property
# LENTICULE_LONGEST_BATCH of the target, or a default. An optimised library is compiled in several batches,
# so that all cores are busy until the end.
function(lenticule_longest_batch result target)
  get_target_property(type ${target} TYPE)
  get_target_property(longest ${target} LENTICULE_LONGEST_BATCH)
  if(longest)
    set(${result} ${longest} PARENT_SCOPE)
  elseif(type STREQUAL STATIC_LIBRARY)
    set(${result} 14 PARENT_SCOPE)
  else()
    set(${result} 30 PARENT_SCOPE)
  endif()
endfunction()

# lenticule_compile_in_batches(): applies to every target defined so far. scripts/source_batches.py
# decides which sources can be combined, and writes the files that combine them.
function(lenticule_compile_in_batches)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  lenticule_targets(targets ${PROJECT_SOURCE_DIR})
  set(questions "")
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(type MATCHES "LIBRARY|EXECUTABLE" AND NOT type STREQUAL INTERFACE_LIBRARY)
      lenticule_cpp_sources(sources ${target})
      list(LENGTH sources count)
      if(count GREATER 1)
        lenticule_longest_batch(longest ${target})
        string(APPEND questions "${target};${longest};${sources}\n")
      endif()
    endif()
  endforeach()
  file(WRITE ${PROJECT_BINARY_DIR}/batch-questions.txt "${questions}")
  execute_process(
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/source_batches.py
      ${PROJECT_BINARY_DIR}/batches
    INPUT_FILE ${PROJECT_BINARY_DIR}/batch-questions.txt
    OUTPUT_VARIABLE answers COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[^\n]+" lines "${answers}")
  set(batched "")
  foreach(line IN LISTS lines)
    string(REPLACE "|" ";" line "${line}")
    list(GET line 0 target)
    list(GET line 1 batch)
    list(GET line 2 source)
    list(APPEND batched ${target})
    list(APPEND replaced_${target} ${source})
    list(APPEND batches_${target} ${batch})
  endforeach()
  list(REMOVE_DUPLICATES batched)
  foreach(target IN LISTS batched)
    get_target_property(sources ${target} SOURCES)
    get_target_property(folder ${target} SOURCE_DIR)
    foreach(source IN LISTS replaced_${target})
      file(RELATIVE_PATH relative ${folder} ${source})
      list(REMOVE_ITEM sources ${source} ${relative})
    endforeach()
    list(REMOVE_DUPLICATES batches_${target})
    set_property(TARGET ${target} PROPERTY SOURCES ${sources} ${batches_${target}})
  endforeach()
endfunction()
