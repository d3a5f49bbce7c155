# SPDX-License-Identifier: Apache-2.0
# Compile options of every target: language, warnings, sanitizers.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_C_STANDARD 11)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

if(NOT CMAKE_BUILD_TYPE)
  set(CMAKE_BUILD_TYPE Release)
endif()

# Uses ccache if it is installed and the user chose no other launcher.
find_program(LENTICULE_CCACHE ccache)
if(LENTICULE_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # ccache requires this setting for files that use a precompiled header.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
    CCACHE_SLOPPINESS=pch_defines,time_macros ${LENTICULE_CCACHE})
  set(CMAKE_C_COMPILER_LAUNCHER ${LENTICULE_CCACHE})
endif()

add_library(lenticule_options INTERFACE)
target_include_directories(lenticule_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_features(lenticule_options INTERFACE cxx_std_20)
# No contraction: a*b+c rounds twice on every machine, so that pictures and maps are byte-identical for
# all instruction sets of the run-time dispatch. No code reads libm's errno.
target_compile_options(lenticule_options INTERFACE -ffp-contract=off -fno-math-errno)
target_compile_definitions(lenticule_options INTERFACE LENTICULE_VERSION="${PROJECT_VERSION}")

# In a batch, locals of one source may shadow file-local names of another, and types may be defined
# outside headers. clang-tidy, which reads each source separately, and builds without batches report
# the true cases.
set(LENTICULE_SOURCE_WARNINGS -Wshadow)
if(LENTICULE_BATCHES)
  # The more gcc inlines, the more often it misestimates lengths: one of these warnings is false for
  # std::string since gcc 12, the others only warn.
  set(LENTICULE_SOURCE_WARNINGS $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage;-Wno-restrict>)
endif()
target_compile_options(lenticule_options INTERFACE
  -Wall -Wextra -Wpedantic ${LENTICULE_SOURCE_WARNINGS} -Wnon-virtual-dtor -Wimplicit-fallthrough -Wconversion
  -Wno-sign-conversion $<$<COMPILE_LANGUAGE:CXX>:-Wold-style-cast>
  # What an initialiser leaves out has its default. Which of these the compilers warn of differs.
  -Wno-missing-field-initializers
  $<$<BOOL:${LENTICULE_WERROR}>:-Werror>)
if(LENTICULE_BATCHES AND LENTICULE_WERROR)
  target_compile_options(lenticule_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-error=array-bounds;-Wno-error=maybe-uninitialized;-Wno-error=stringop-overflow;-Wno-error=stringop-overread>)
endif()

# The options of Debian's hardening=+all: a fault in a program that reads untrusted files and messages
# ends the program instead of being exploitable. The speed of kernels and the bytes of pictures do not
# change. Sanitizers make the same checks, and fortified calls would hide faults from them.
if(NOT LENTICULE_SANITIZE AND NOT LENTICULE_BUILD_FUZZ)
  include(CheckPIESupported)
  check_pie_supported()
  set(branches "")
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    set(branches -fcf-protection)
  elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    set(branches -mbranch-protection=standard)
  endif()
  set(stack -fstack-protector-strong)
  if(NOT (CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64"))
    list(APPEND stack -fstack-clash-protection)  # clang 14 does not have it for arm64
  endif()
  # Fortified calls require optimisation; only test programs can have the property.
  target_compile_options(lenticule_options INTERFACE
    ${stack} ${branches} -Werror=format-security
    $<$<NOT:$<OR:$<CONFIG:Debug>,$<BOOL:$<TARGET_PROPERTY:LENTICULE_UNOPTIMISED>>>>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2>)
  target_link_options(lenticule_options INTERFACE LINKER:-z,relro LINKER:-z,now)
endif()
# Makes failed checks name files relative to the source tree, without the build machine's folders.
target_compile_options(lenticule_options INTERFACE -fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)

# A sanitizer's checks keep a kernel from being fast, and take long to optimise.
set(LENTICULE_KERNEL_OPTIMISATION -O3)
if(LENTICULE_SANITIZE)
  set(LENTICULE_KERNEL_OPTIMISATION "")
endif()

if(LENTICULE_SANITIZE)
  target_compile_options(lenticule_options INTERFACE
    -fsanitize=${LENTICULE_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(lenticule_options INTERFACE -fsanitize=${LENTICULE_SANITIZE})
  # A sanitizer calls dlopen on behalf of the program. Then only the program's RPATH is searched, and
  # with a RUNPATH the module that reads pictures would not be found.
  target_link_options(lenticule_options INTERFACE -Wl,--disable-new-dtags)
endif()
if(LENTICULE_BUILD_FUZZ)
  # A fuzzer observes which code runs; the test programs that share its libraries do not.
  target_compile_options(lenticule_options INTERFACE
    $<$<NOT:$<BOOL:$<TARGET_PROPERTY:LENTICULE_UNOPTIMISED>>>:-fsanitize=fuzzer-no-link>)
endif()
