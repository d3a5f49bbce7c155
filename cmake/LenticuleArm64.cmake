# SPDX-License-Identifier: Apache-2.0
# Toolchain for arm64 on a Debian host of another architecture. `scripts/packages arm64` installs the
# compiler and qemu, and makes the sysroot: the arm64 libraries of the same Debian, extracted to a folder.
# It is in the user's cache, or where the environment variable LENTICULE_SYSROOT says. With the CMake variable
# LENTICULE_CROSS_CLANG, clang compiles, in half the time of gcc.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(triplet aarch64-linux-gnu)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES LENTICULE_CROSS_CLANG)
if(LENTICULE_CROSS_CLANG)
  set(CMAKE_C_COMPILER clang)
  set(CMAKE_CXX_COMPILER clang++)
  set(CMAKE_C_COMPILER_TARGET ${triplet})
  set(CMAKE_CXX_COMPILER_TARGET ${triplet})
  set(CMAKE_EXE_LINKER_FLAGS_INIT -fuse-ld=lld)
  set(CMAKE_SHARED_LINKER_FLAGS_INIT -fuse-ld=lld)
else()
  set(CMAKE_C_COMPILER ${triplet}-gcc)
  set(CMAKE_CXX_COMPILER ${triplet}-g++)
endif()
set(CMAKE_LIBRARY_ARCHITECTURE ${triplet})

if(DEFINED ENV{LENTICULE_SYSROOT})
  set(CMAKE_SYSROOT $ENV{LENTICULE_SYSROOT})
elseif(DEFINED ENV{XDG_CACHE_HOME})
  set(CMAKE_SYSROOT $ENV{XDG_CACHE_HOME}/lenticule/sysroot-arm64)
else()
  set(CMAKE_SYSROOT $ENV{HOME}/.cache/lenticule/sysroot-arm64)
endif()
if(NOT EXISTS ${CMAKE_SYSROOT}/usr/include)
  message(FATAL_ERROR "${CMAKE_SYSROOT}: no sysroot for arm64; `scripts/packages arm64` makes it")
endif()

# Headers and libraries come from the sysroot only, programs from the host only.
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_PATH} "")
set(ENV{PKG_CONFIG_LIBDIR} ${CMAKE_SYSROOT}/usr/lib/${triplet}/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})

# Programs of the build, for example tests, run in qemu's user mode.
find_program(LENTICULE_QEMU NAMES qemu-aarch64 qemu-aarch64-static)
if(LENTICULE_QEMU)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${LENTICULE_QEMU} -L ${CMAKE_SYSROOT})
endif()
