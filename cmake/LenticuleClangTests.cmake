# SPDX-License-Identifier: Apache-2.0
# Compiles the C++ sources of this folder and of those below it with clang, whatever compiles the
# libraries. Unoptimised, clang takes a third of the time that gcc takes for a test program at -O1.
#
# CMake supports one compiler per language. But it reads the variables that describe the compiler in the
# folder of each target, so that another one can be described here, as project() does.
find_program(LENTICULE_CLANG clang++ REQUIRED)
execute_process(COMMAND ${LENTICULE_CLANG} -dumpversion
  OUTPUT_VARIABLE CMAKE_CXX_COMPILER_VERSION OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY)
set(CMAKE_CXX_COMPILER ${LENTICULE_CLANG})
set(CMAKE_CXX_COMPILER_ID Clang)
set(CMAKE_CXX_COMPILER_FRONTEND_VARIANT GNU)
include(Compiler/Clang-CXX)
