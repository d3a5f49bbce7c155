# SPDX-License-Identifier: Apache-2.0
# What `cmake --install` puts in place: the program, its manual and completion scripts (made by the
# program itself), the sample rigs, the documentation. include/ installs the C API.
install(TARGETS lenticule_program RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})

set(generated ${PROJECT_BINARY_DIR}/generated)
set(generated_files lenticule.1 lenticule.bash _lenticule lenticule.fish)
list(TRANSFORM generated_files PREPEND ${generated}/)
add_custom_command(OUTPUT ${generated_files}
  COMMAND ${CMAKE_COMMAND} -E make_directory ${generated}
  COMMAND lenticule_program man > ${generated}/lenticule.1
  COMMAND lenticule_program completion bash > ${generated}/lenticule.bash
  COMMAND lenticule_program completion zsh > ${generated}/_lenticule
  COMMAND lenticule_program completion fish > ${generated}/lenticule.fish
  DEPENDS lenticule_program VERBATIM
  COMMENT "Writing the manual page and the completion scripts")
add_custom_target(lenticule_manual ALL DEPENDS ${generated_files})

install(FILES ${generated}/lenticule.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES ${generated}/lenticule.bash RENAME lenticule
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES ${generated}/_lenticule DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(FILES ${generated}/lenticule.fish
  DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
install(DIRECTORY scenes/rigs DESTINATION ${CMAKE_INSTALL_DATADIR}/lenticule)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} FILES_MATCHING PATTERN "*.md" PATTERN "*.svg" PATTERN "*.png")
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})

# What a kiosk's system needs. Below "lib", not the multiarch folder: systemd and udev look there,
# in /usr and in /usr/local.
install(FILES udev/70-lenticule.rules DESTINATION lib/udev/rules.d)
install(FILES udev/lenticule-player@.service udev/lenticule-renderer@.service
  DESTINATION lib/systemd/system)
install(FILES udev/lenticule.sysusers DESTINATION lib/sysusers.d RENAME lenticule.conf)
install(FILES udev/lenticule.tmpfiles DESTINATION lib/tmpfiles.d RENAME lenticule.conf)

# cpack -G DEB: one package; dpkg-shlibdeps finds the libraries that it depends on.
set(CPACK_GENERATOR DEB)
# A package's maintainer is whoever builds it, as Debian's own tools see it: DEBFULLNAME and DEBEMAIL,
# else root of the building machine.
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
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY ${PROJECT_DESCRIPTION})
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_DEPENDS "systemd, udev")
set(CPACK_DEBIAN_PACKAGE_DESCRIPTION
"Renders scenes, weaves other people's pictures and videos for a display behind
a sheet of cylinder lenses, and plays them subpixel by subpixel as they are.
Finds the lens sheet with a camera, from photographs or by eye. Comes with
units of systemd for machines that do nothing else, and with a C library for
programs that render for such a display.")
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA
  ${PROJECT_SOURCE_DIR}/cmake/debian/postinst ${PROJECT_SOURCE_DIR}/cmake/debian/prerm
  ${PROJECT_SOURCE_DIR}/cmake/debian/postrm ${PROJECT_SOURCE_DIR}/cmake/debian/triggers)
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/cmake/LenticulePackage.cmake)
include(CPack)
