# SPDX-License-Identifier: Apache-2.0
# Run by cpack on the tree to be packed. Adds the documentation that Debian requires: a compressed
# manual, a changelog, and the licence with a reference to its common copy.
file(GLOB_RECURSE manuals ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/*/lenticule.1)
list(GET manuals 0 manual)
cmake_path(SET usr NORMALIZE ${manual}/../../../..)
set(documents ${usr}/share/doc/lenticule)

string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # uses SOURCE_DATE_EPOCH if set
file(WRITE ${documents}/changelog
  "lenticule (${CPACK_PACKAGE_VERSION}) unstable; urgency=medium\n\n  * Built from source.\n\n"
  " -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
execute_process(COMMAND gzip -9nf ${manual} ${documents}/changelog COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE ${documents}/LICENSE)
file(COPY ${CMAKE_CURRENT_LIST_DIR}/debian/copyright DESTINATION ${documents})
configure_file(${CMAKE_CURRENT_LIST_DIR}/debian/lintian-overrides
  ${usr}/share/lintian/overrides/lenticule COPYONLY)
