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

# System files for a kiosk.
install(FILES udev/70-lenticule.rules DESTINATION ${LENTICULE_UDEV_DIR} COMPONENT player)
install(FILES udev/lenticule-player@.service udev/lenticule-renderer@.service
  DESTINATION ${LENTICULE_UNIT_DIR} COMPONENT player)
install(FILES udev/lenticule.sysusers
  DESTINATION ${LENTICULE_SYSUSERS_DIR} RENAME lenticule.conf COMPONENT player)
install(FILES udev/lenticule-web@.service udev/lenticule-web@.socket
  DESTINATION ${LENTICULE_UNIT_DIR} COMPONENT web)
install(FILES udev/lenticule-player-web.conf
  DESTINATION ${LENTICULE_UNIT_DIR}/lenticule-player@.service.d RENAME web.conf COMPONENT web)
install(FILES udev/lenticule-web.sysusers
  DESTINATION ${LENTICULE_SYSUSERS_DIR} RENAME lenticule-web.conf COMPONENT web)
install(FILES udev/lenticule.tmpfiles
  DESTINATION ${LENTICULE_TMPFILES_DIR} RENAME lenticule.conf COMPONENT player)

# lenticule_set_folders(COMPONENT FILE ...)
#   Replaces the folders in installed files by those of this installation: its prefix is known when it is
#   installed, not before.
function(lenticule_set_folders component)
  install(CODE "
    cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_PREFIX OUTPUT_VARIABLE prefix)
    foreach(file IN ITEMS ${ARGN})
      cmake_path(ABSOLUTE_PATH file BASE_DIRECTORY \"\${prefix}\")
      file(READ \"\$ENV{DESTDIR}\${file}\" text)
      set(programs ${CMAKE_INSTALL_BINDIR})
      cmake_path(ABSOLUTE_PATH programs BASE_DIRECTORY \"\${prefix}\")
      string(REPLACE \"ExecStart=lenticule \" \"ExecStart=\${programs}/lenticule \" text \"\${text}\")
      string(REPLACE \"/etc/lenticule\" \"${LENTICULE_SYSTEM_FOLDER}\" text \"\${text}\")
      file(WRITE \"\$ENV{DESTDIR}\${file}\" \"\${text}\")
    endforeach()" COMPONENT ${component})
endfunction()
lenticule_set_folders(player ${LENTICULE_TMPFILES_DIR}/lenticule.conf
  ${LENTICULE_UNIT_DIR}/lenticule-player@.service ${LENTICULE_UNIT_DIR}/lenticule-renderer@.service)
lenticule_set_folders(web ${LENTICULE_UNIT_DIR}/lenticule-web@.service)
