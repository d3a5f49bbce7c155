# SPDX-License-Identifier: Apache-2.0
# Compiles many sources of a target as one, so that shared headers are read once. This halves the work
# of a full build; an incremental build would compile more than changed.

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

# lenticule_cpp_sources(RESULT TARGET): lists the absolute paths of the C++ sources in the source tree.
function(lenticule_cpp_sources result target)
  get_target_property(sources ${target} SOURCES)
  get_target_property(folder ${target} SOURCE_DIR)
  list(FILTER sources INCLUDE REGEX "^[^$<>]*\\.cpp$")
  list(TRANSFORM sources PREPEND ${folder}/ REGEX "^[^/]")
  list(FILTER sources INCLUDE REGEX "^${PROJECT_SOURCE_DIR}/")
  list(FILTER sources EXCLUDE REGEX "^${PROJECT_BINARY_DIR}/")
  set(${result} ${sources} PARENT_SCOPE)
endfunction()

# lenticule_compile_in_batches(): applies to every target defined so far. scripts/source_batches.py
# estimates which sources can be combined; set SKIP_UNITY_BUILD_INCLUSION on a source that cannot.
function(lenticule_compile_in_batches)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  lenticule_targets(targets ${PROJECT_SOURCE_DIR})
  set(questions "")
  foreach(target IN LISTS targets)
    get_target_property(type ${target} TYPE)
    if(type MATCHES "LIBRARY|EXECUTABLE")
      lenticule_cpp_sources(sources ${target})
      list(LENGTH sources count)
      if(count GREATER 1)
        string(APPEND questions "${target};${sources}\n")
        set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
      endif()
    endif()
  endforeach()
  file(WRITE ${PROJECT_BINARY_DIR}/batch-questions.txt "${questions}")
  execute_process(
    COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/scripts/source_batches.py 8
    INPUT_FILE ${PROJECT_BINARY_DIR}/batch-questions.txt
    OUTPUT_VARIABLE answers COMMAND_ERROR_IS_FATAL ANY)
  string(REGEX MATCHALL "[^\n]+" lines "${answers}")
  foreach(line IN LISTS lines)
    string(REPLACE "|" ";" line "${line}")
    list(GET line 0 target)
    list(GET line 1 batch)
    list(GET line 2 source)
    set_source_files_properties(${source} TARGET_DIRECTORY ${target} PROPERTIES UNITY_GROUP ${batch})
  endforeach()
endfunction()
