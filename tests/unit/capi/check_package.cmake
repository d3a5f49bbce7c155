# SPDX-License-Identifier: Apache-2.0
# Installs the C API into a scratch folder and builds the example against it as its users would: once
# with pkg-config, once with find_package.
cmake_minimum_required(VERSION 3.25)

set(scratch ${BUILD}/capi-package)
file(REMOVE_RECURSE ${scratch})
foreach(component library development)
  execute_process(COMMAND ${CMAKE_COMMAND} --install ${BUILD} --component ${component}
    --prefix ${scratch}/tree OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
endforeach()

file(GLOB_RECURSE pc ${scratch}/tree/lenticule.pc)
get_filename_component(pc_folder ${pc} DIRECTORY)
set(ENV{PKG_CONFIG_PATH} ${pc_folder})
execute_process(COMMAND pkg-config --cflags --libs lenticule
  OUTPUT_VARIABLE flags OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
set(sanitize "")
if(SANITIZE)
  set(sanitize -fsanitize=${SANITIZE})
endif()
execute_process(COMMAND ${CC} ${EXAMPLE} ${flags} ${sanitize} -o ${scratch}/by_pkg_config
  COMMAND_ERROR_IS_FATAL ANY)

file(WRITE ${scratch}/consumer/CMakeLists.txt "cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES C)
find_package(lenticule 0.1 REQUIRED)
add_executable(by_cmake ${EXAMPLE})
target_compile_options(by_cmake PRIVATE ${sanitize})
target_link_options(by_cmake PRIVATE ${sanitize})
target_link_libraries(by_cmake PRIVATE lenticule::capi)
")
execute_process(COMMAND ${CMAKE_COMMAND} -S ${scratch}/consumer -B ${scratch}/consumer/build
  -DCMAKE_PREFIX_PATH=${scratch}/tree -DCMAKE_C_COMPILER=${CC}
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${CMAKE_COMMAND} --build ${scratch}/consumer/build
  OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
