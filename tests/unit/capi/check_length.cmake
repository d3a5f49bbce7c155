# SPDX-License-Identifier: Apache-2.0
# Fails if FILE has more than MOST lines.
cmake_minimum_required(VERSION 3.25)

file(READ ${FILE} text)
string(REGEX MATCHALL "\n" ends "${text}")
list(LENGTH ends lines)
if(lines LESS 10 OR lines GREATER ${MOST})
  message(FATAL_ERROR "${FILE} has ${lines} lines, at most ${MOST} are allowed")
endif()
