# SPDX-License-Identifier: Apache-2.0
# Everything the rooms link, found once. No network access at configure time.
find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(fmt REQUIRED)
find_package(TBB REQUIRED)
# By pkg-config: Debian's CMake package of OpenImageIO wants its command-line tools to be installed and
# names the header folder of an OpenCV that it does not depend on.
pkg_check_modules(OPENIMAGEIO REQUIRED IMPORTED_TARGET OpenImageIO)
find_package(assimp REQUIRED)
find_package(CLI11 REQUIRED)
find_package(nlohmann_json REQUIRED)
pkg_check_modules(TOMLPLUSPLUS REQUIRED IMPORTED_TARGET tomlplusplus)
pkg_check_modules(XXHASH REQUIRED IMPORTED_TARGET libxxhash)
pkg_check_modules(ZSTD REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(LIBDRM REQUIRED IMPORTED_TARGET libdrm)
pkg_check_modules(LIBUDEV REQUIRED IMPORTED_TARGET libudev)
pkg_check_modules(LIBCRYPTO REQUIRED IMPORTED_TARGET libcrypto)
pkg_check_modules(LIBSEAT IMPORTED_TARGET libseat)
find_package(Ceres REQUIRED)
find_package(Eigen3 REQUIRED)
pkg_check_modules(TURBOJPEG REQUIRED IMPORTED_TARGET libturbojpeg)
pkg_check_modules(APRILTAG REQUIRED IMPORTED_TARGET apriltag)
# FFmpeg 5.1 (Debian 12) or later, for lenticule-video only.
pkg_check_modules(FFMPEG REQUIRED IMPORTED_TARGET libavformat libavcodec libavutil)
pkg_check_modules(LIBSYSTEMD REQUIRED IMPORTED_TARGET libsystemd)

# Embree 4 where the distribution has it, Embree 3 (Debian 12) otherwise: render/accel/embree.h hides the
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
