# SPDX-License-Identifier: Apache-2.0
# Installs the manual and the completion scripts, the sample rigs, the documentation and the system
# files. Each program is installed by its folder, the C API by include/. LenticulePackages.cmake makes a
# package of each component.
if(LENTICULE_RENDER)  # lenticule-tools writes them
  set(generated ${PROJECT_BINARY_DIR}/generated)
  set(generated_files lenticule.1 lenticule.bash _lenticule lenticule.fish)
  list(TRANSFORM generated_files PREPEND ${generated}/)
  add_custom_command(OUTPUT ${generated_files}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${generated}
    COMMAND lenticule_tools_program man > ${generated}/lenticule.1
    COMMAND lenticule_tools_program completion bash > ${generated}/lenticule.bash
    COMMAND lenticule_tools_program completion zsh > ${generated}/_lenticule
    COMMAND lenticule_tools_program completion fish > ${generated}/lenticule.fish
    DEPENDS lenticule_tools_program VERBATIM
    COMMENT "Writing the manual page and the completion scripts")
  add_custom_target(lenticule_manual ALL DEPENDS ${generated_files})

  install(FILES ${generated}/lenticule.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT player)
  install(FILES ${generated}/lenticule.bash RENAME lenticule
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT player)
  install(FILES ${generated}/_lenticule
    DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT player)
  install(FILES ${generated}/lenticule.fish
    DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT player)
endif()
install(DIRECTORY scenes/rigs DESTINATION ${CMAKE_INSTALL_DATADIR}/lenticule COMPONENT player)
install(DIRECTORY docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tools
  FILES_MATCHING PATTERN "*.md" PATTERN "*.svg" PATTERN "*.png")
install(FILES README.md LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT tools)

# System files for a kiosk. They go to "lib" instead of the multiarch folder, because systemd and udev
# search there, in /usr and in /usr/local.
install(FILES udev/70-lenticule.rules DESTINATION lib/udev/rules.d COMPONENT player)
install(FILES udev/lenticule-player@.service udev/lenticule-renderer@.service
  DESTINATION lib/systemd/system COMPONENT player)
install(FILES udev/lenticule.sysusers
  DESTINATION lib/sysusers.d RENAME lenticule.conf COMPONENT player)
install(FILES udev/lenticule-web@.service udev/lenticule-web@.socket
  DESTINATION lib/systemd/system COMPONENT web)
install(FILES udev/lenticule-player-web.conf
  DESTINATION lib/systemd/system/lenticule-player@.service.d RENAME web.conf COMPONENT web)
install(FILES udev/lenticule-web.sysusers
  DESTINATION lib/sysusers.d RENAME lenticule-web.conf COMPONENT web)
install(FILES udev/lenticule.tmpfiles
  DESTINATION lib/tmpfiles.d RENAME lenticule.conf COMPONENT player)
