# SPDX-License-Identifier: Apache-2.0
# Fails unless the library exports every function of lenticule.h and nothing that is not lenticule_*.
cmake_minimum_required(VERSION 3.25)

execute_process(COMMAND ${NM} -D --defined-only --format=posix ${LIBRARY}
  OUTPUT_VARIABLE listing COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[^\n]+" lines "${listing}")
set(exported "")
foreach(line IN LISTS lines)
  string(REGEX REPLACE "[@ ].*" "" name "${line}")
  if(name STREQUAL "LENTICULE_0")  # the name of the symbol version itself
    continue()
  endif()
  if(NOT name MATCHES "^lenticule_")
    message(SEND_ERROR "${LIBRARY} exports ${name}")
  endif()
  list(APPEND exported ${name})
endforeach()

file(READ ${CMAKE_CURRENT_LIST_DIR}/../../../include/lenticule.h header)
string(REGEX REPLACE "/\\*[^*]*\\*+([^/*][^*]*\\*+)*/" "" header "${header}")
string(REGEX MATCHALL "lenticule_[a-z_]+\\(" declared "${header}")
list(LENGTH declared count)
if(count LESS 14)
  message(SEND_ERROR "only ${count} functions found in lenticule.h")
endif()
foreach(function IN LISTS declared)
  string(REPLACE "(" "" function ${function})
  if(NOT function IN_LIST exported)
    message(SEND_ERROR "${LIBRARY} does not export ${function}")
  endif()
endforeach()
