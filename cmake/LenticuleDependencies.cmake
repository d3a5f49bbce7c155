# SPDX-License-Identifier: Apache-2.0
# Everything the rooms link, found once. No network access at configure time.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(fmt REQUIRED)
find_package(TBB REQUIRED)
find_package(OpenImageIO REQUIRED)
# Debian's OpenImageIO names the header folder of an OpenCV that it does not depend on; a folder that
# is not there would stop the configuration.
get_target_property(oiio_includes OpenImageIO::OpenImageIO INTERFACE_INCLUDE_DIRECTORIES)
set(oiio_existing "")
foreach(folder IN LISTS oiio_includes)
  if(EXISTS ${folder})
    list(APPEND oiio_existing ${folder})
  endif()
endforeach()
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES
  INTERFACE_INCLUDE_DIRECTORIES "${oiio_existing}")
find_package(assimp REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
pkg_check_modules(TOMLPLUSPLUS REQUIRED IMPORTED_TARGET tomlplusplus)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(LIBDRM REQUIRED IMPORTED_TARGET libdrm)
pkg_check_modules(LIBUDEV REQUIRED IMPORTED_TARGET libudev)
pkg_check_modules(LIBCRYPTO REQUIRED IMPORTED_TARGET libcrypto)
pkg_check_modules(LIBSEAT IMPORTED_TARGET libseat)
pkg_check_modules(LIBSYSTEMD REQUIRED IMPORTED_TARGET libsystemd)

# Embree 4 where the distribution has it, Embree 3 (Debian 12) otherwise: render/embree.h hides the
# difference.
find_package(embree 4 QUIET)
if(NOT embree_FOUND)
  find_package(embree 3.13 REQUIRED)
endif()

if(LENTICULE_BUILD_TESTS)
  find_package(GTest REQUIRED)
  include(GoogleTest)
  if(LENTICULE_BUILD_BENCH)
    find_package(benchmark REQUIRED)
  endif()
endif()
