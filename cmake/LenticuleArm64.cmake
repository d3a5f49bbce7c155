# SPDX-License-Identifier: Apache-2.0
# Toolchain for arm64 on a Debian host of another architecture. `scripts/packages arm64` installs the
# compiler and qemu, and makes the sysroot: the arm64 libraries of the same Debian, extracted to a folder.
# The environment variable LENTICULE_SYSROOT names another folder.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(triplet aarch64-linux-gnu)
set(CMAKE_C_COMPILER ${triplet}-gcc)
set(CMAKE_CXX_COMPILER ${triplet}-g++)
set(CMAKE_LIBRARY_ARCHITECTURE ${triplet})

if(DEFINED ENV{LENTICULE_SYSROOT})
  set(CMAKE_SYSROOT $ENV{LENTICULE_SYSROOT})
else()
  get_filename_component(CMAKE_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-arm64 ABSOLUTE)
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
