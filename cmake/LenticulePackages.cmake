# SPDX-License-Identifier: Apache-2.0
# cpack -G DEB makes a package of each component; dpkg-shlibdeps finds the libraries that it depends on.
# docs/play/packages.md says what is where, and why.
set(CPACK_GENERATOR DEB)
# The packages' maintainer is the user who builds them, as in Debian's own tools: DEBFULLNAME and
# DEBEMAIL, else root of the building machine.
set(contact_name "$ENV{DEBFULLNAME}")
set(contact_address "$ENV{DEBEMAIL}")
cmake_host_system_information(RESULT contact_host QUERY HOSTNAME)
if(NOT contact_name)
  set(contact_name "built from source")
endif()
if(NOT contact_address)
  set(contact_address "root@${contact_host}")
endif()
set(CPACK_PACKAGE_CONTACT "${contact_name} <${contact_address}>")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
# Packages of a later Debian are newer, so that apt replaces them when the system is upgraded. Debian's
# next release has no number yet, and is newer than all.
cmake_host_system_information(RESULT debian QUERY DISTRIB_VERSION_ID)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
if(debian)
  string(APPEND CPACK_DEBIAN_PACKAGE_RELEASE "~deb${debian}")
endif()
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/LenticulePackageTree.cmake)

set(same "(= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE})")

# lenticule_package(COMPONENT PACKAGE SUMMARY TEXT [DEPENDS ...] [RECOMMENDS ...] [SECTION ...]
#                   [SCRIPTS ...])
#   Describes the package of a component.
macro(lenticule_package component package summary text)
  cmake_parse_arguments(PACKAGE "" "SECTION;RECOMMENDS" "DEPENDS;SCRIPTS" ${ARGN})
  string(TOUPPER ${component} upper)
  list(APPEND CPACK_COMPONENTS_ALL ${component})
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${summary}\n${text}")
  list(JOIN PACKAGE_DEPENDS ", " CPACK_DEBIAN_${upper}_PACKAGE_DEPENDS)
  set(CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA ${PACKAGE_SCRIPTS})
  list(TRANSFORM CPACK_DEBIAN_${upper}_PACKAGE_CONTROL_EXTRA
    PREPEND ${PROJECT_SOURCE_DIR}/cmake/debian/)
  if(PACKAGE_RECOMMENDS)
    set(CPACK_DEBIAN_${upper}_PACKAGE_RECOMMENDS "${PACKAGE_RECOMMENDS}")
  endif()
  if(PACKAGE_SECTION)
    set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${PACKAGE_SECTION})
  endif()
endmacro()

set(about
"Part of lenticule, which shows 3-D pictures on displays behind a sheet of
cylinder lenses.")
lenticule_package(player lenticule-player "player for lenticular 3-D displays"
"${about}
.
Plays woven frames and films subpixel by subpixel as they are, and weaves
quilts while it plays. Comes with units of systemd for machines that do
nothing else. Pictures and video files need lenticule-media."
  DEPENDS systemd udev procps RECOMMENDS "lenticule-media ${same}" SCRIPTS postinst prerm postrm)
if(TARGET lenticule_pictures)
  lenticule_package(media lenticule-media "picture and video decoders for lenticular 3-D displays"
"${about}
.
Reads and writes picture and video files for the other packages of lenticule.
Files are decoded in a process without rights."
    # Debian 12's libheif contains its decoders.
    DEPENDS "lenticule-player ${same}" "libheif-plugin-libde265 | libheif1 (<< 1.16)"
    SCRIPTS no-ldconfig/postinst no-ldconfig/postrm)
endif()
if(LENTICULE_WEB)
  lenticule_package(web lenticule-web "pages and HTTP interface for players of lenticular 3-D displays"
"${about}
.
Pages on which a phone or a browser watches and controls the player of a
kiosk: what plays, the list and its files, the picture that an eye sees, the
trim of the lens sheet, and metrics for Prometheus."
    DEPENDS "lenticule-player ${same}" RECOMMENDS "lenticule-media ${same}"
    SCRIPTS web/postinst web/prerm web/postrm)
endif()
if(SDL2_FOUND)
  lenticule_package(window lenticule-window "preview window for lenticular 3-D displays"
"${about}
.
Shows on a desktop what two eyes in front of a panel see, side by side or for
red-cyan glasses, for authors without a panel."
    DEPENDS "lenticule-player ${same}")
endif()
if(LENTICULE_RENDER)
  lenticule_package(tools lenticule "renderer and tools for lenticular 3-D displays"
"Renders scenes, and weaves other people's pictures and videos for a display
behind a sheet of cylinder lenses. Finds the lens sheet with a camera, from
photographs or by eye."
    DEPENDS "lenticule-player ${same}" "lenticule-media ${same}")
endif()
if(LENTICULE_BUILD_BENCH)
  lenticule_package(bench lenticule-bench "benchmarks for lenticular 3-D displays"
"${about}
.
Measures renderer, player, codecs and calibration on this machine."
    DEPENDS "lenticule ${same}")
endif()
lenticule_package(library liblenticule0 "C library of renderers for lenticular 3-D displays"
"${about}
.
Passes the frames of any program to the player, through shared memory."
  SECTION libs SCRIPTS triggers no-ldconfig/postinst no-ldconfig/postrm)
lenticule_package(development liblenticule-dev "C library of renderers for lenticular 3-D displays - headers"
"${about}
.
Header, and files for CMake and pkg-config."
  DEPENDS "liblenticule0 ${same}" SECTION libdevel)

# Each package has its own summary. cpack takes a summary of all packages for one that was not set.
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${CMAKE_PROJECT_NAME} built using CMake")
include(CPack)
