# SPDX-License-Identifier: Apache-2.0
# What modules and programs are made of: lists of sources, libraries, programs, and kernels for each instruction set.

# The headers that take most of the compile time of the sources that include them, precompiled once for all
# libraries that are LIGHT.
file(CONFIGURE OUTPUT heavy_headers.cpp CONTENT "// Carries the precompiled headers.\n")
add_library(lenticule_heavy_headers OBJECT ${CMAKE_CURRENT_BINARY_DIR}/heavy_headers.cpp)
target_link_libraries(lenticule_heavy_headers PRIVATE
  lenticule_options CLI11::CLI11 fmt::fmt nlohmann_json::nlohmann_json)
target_compile_options(lenticule_heavy_headers PRIVATE $<$<CONFIG:Release>:-O1>)
target_precompile_headers(lenticule_heavy_headers PRIVATE <CLI/CLI.hpp> <fmt/format.h> <nlohmann/json.hpp>)

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
    target_compile_options(lenticule_${name} PRIVATE $<$<CONFIG:Release>:-O1>)
    target_precompile_headers(lenticule_${name} REUSE_FROM lenticule_heavy_headers)
    lenticule_batches(lenticule_${name} 30)
  else()
    lenticule_batches(lenticule_${name} 14)
  endif()
endfunction()

# lenticule_program(NAME COMPONENT [LIGHT] [DEPENDS ...] [SOURCES PATTERN ...])
#   Adds the program lenticule-NAME (target lenticule_NAME_program) of main.cpp and the sources. It is built
#   beside lenticule, and installed into the folder for helper programs. LIGHT: its main.cpp does not compute much.
function(lenticule_program name component)
  cmake_parse_arguments(PROGRAM "LIGHT" "" "SOURCES;DEPENDS" ${ARGN})
  lenticule_sources(sources main.cpp ${PROGRAM_SOURCES})
  add_executable(lenticule_${name}_program ${sources})
  set_target_properties(lenticule_${name}_program PROPERTIES
    OUTPUT_NAME lenticule-${name} RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}
    INSTALL_RPATH ${LENTICULE_HELPER_RPATH})
  target_link_libraries(lenticule_${name}_program PRIVATE ${PROGRAM_DEPENDS})
  if(PROGRAM_LIGHT)
    target_compile_options(lenticule_${name}_program PRIVATE $<$<CONFIG:Release>:-O1>)
  endif()
  lenticule_batches(lenticule_${name}_program 30)
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
