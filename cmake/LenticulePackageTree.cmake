# SPDX-License-Identifier: Apache-2.0
# Run by cpack on the trees to be packed, one for each component. Adds the documentation that Debian
# requires: compressed manuals, a changelog, and the licence with a reference to its common copy.
string(TIMESTAMP date "%a, %d %b %Y %H:%M:%S +0000" UTC)  # uses SOURCE_DATE_EPOCH if set
foreach(component IN LISTS CPACK_COMPONENTS_ALL)
  string(TOUPPER ${component} upper)
  set(package ${CPACK_DEBIAN_${upper}_PACKAGE_NAME})
  set(usr ${CPACK_TEMPORARY_INSTALL_DIRECTORY}/${component}${CPACK_PACKAGING_INSTALL_PREFIX})
  set(documents ${usr}/share/doc/${package})

  # Where Debian's zsh looks for the functions of packages.
  if(EXISTS ${usr}/share/zsh/site-functions)
    file(RENAME ${usr}/share/zsh/site-functions ${usr}/share/zsh/vendor-completions)
  endif()
  file(WRITE ${documents}/changelog.Debian
    "lenticule (${CPACK_PACKAGE_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}) unstable; urgency=medium\n\n"
    "  * Built from source.\n\n"
    " -- ${CPACK_PACKAGE_CONTACT}  ${date}\n")
  file(GLOB manuals ${usr}/share/man/*/*)
  execute_process(COMMAND gzip -9nf ${manuals} ${documents}/changelog.Debian
    COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE ${documents}/LICENSE)
  file(COPY ${CMAKE_CURRENT_LIST_DIR}/debian/copyright DESTINATION ${documents}
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE GROUP_READ WORLD_READ)
  # The overrides of all packages, and those of this one.
  set(overrides "")
  foreach(name IN ITEMS lintian-overrides ${package}.lintian-overrides)
    if(EXISTS ${CMAKE_CURRENT_LIST_DIR}/debian/${name})
      file(READ ${CMAKE_CURRENT_LIST_DIR}/debian/${name} text)
      string(APPEND overrides "${text}")
    endif()
  endforeach()
  file(WRITE ${usr}/share/lintian/overrides/${package} "${overrides}")
endforeach()
