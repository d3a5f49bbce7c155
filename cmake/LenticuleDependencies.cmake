# SPDX-License-Identifier: Apache-2.0
# Finds all dependencies of the modules once. Configuring needs no network access.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(fmt REQUIRED)
find_package(TBB REQUIRED)
# Uses pkg-config, because Debian's CMake package of OpenImageIO requires its command-line tools and
# names the header folder of OpenCV, on which it does not depend.
pkg_check_modules(OPENIMAGEIO REQUIRED IMPORTED_TARGET OpenImageIO)
find_package(assimp REQUIRED)
find_package(draco REQUIRED)
find_package(meshoptimizer REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
pkg_check_modules(TOMLPLUSPLUS REQUIRED IMPORTED_TARGET tomlplusplus)
pkg_check_modules(SPNG REQUIRED IMPORTED_TARGET spng)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(LIBDRM REQUIRED IMPORTED_TARGET libdrm)
pkg_check_modules(LIBUDEV REQUIRED IMPORTED_TARGET libudev)
pkg_check_modules(LIBCRYPTO REQUIRED IMPORTED_TARGET libcrypto)
pkg_check_modules(LIBSEAT IMPORTED_TARGET libseat)
pkg_check_modules(TURBOJPEG REQUIRED IMPORTED_TARGET libturbojpeg)
pkg_check_modules(MICROHTTPD REQUIRED IMPORTED_TARGET libmicrohttpd)
pkg_check_modules(QRENCODE REQUIRED IMPORTED_TARGET libqrencode)
if(LENTICULE_CALIBRATE)
  find_package(Ceres REQUIRED)
  find_package(Eigen3 REQUIRED)
  pkg_check_modules(APRILTAG REQUIRED IMPORTED_TARGET apriltag)
endif()
# For lenticule-video only: FFmpeg 5.1 (Debian 12) or later, and the filter of system calls.
pkg_check_modules(FFMPEG REQUIRED IMPORTED_TARGET libavformat libavcodec libavutil)
pkg_check_modules(LIBSECCOMP REQUIRED IMPORTED_TARGET libseccomp)
# For lenticule-window only; without SDL there is no --display window.
pkg_check_modules(SDL2 IMPORTED_TARGET sdl2)
pkg_check_modules(LIBSYSTEMD REQUIRED IMPORTED_TARGET libsystemd)

# Embree 4 if the distribution has it, otherwise Embree 3 (Debian 12): render/accel/embree.h hides the
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
