# SPDX-License-Identifier: Apache-2.0
# The folders of the installed tree: those of GNUInstallDirs, and those that systemd and udev search. Each may be
# below the prefix or absolute. docs/building.md lists them.

include(GNUInstallDirs)
# Services have their configuration in /etc, whatever the prefix is, unless another folder than GNU's is named.
set(LENTICULE_SYSTEM_FOLDER ${CMAKE_INSTALL_FULL_SYSCONFDIR}/lenticule)
if(CMAKE_INSTALL_SYSCONFDIR STREQUAL etc)
  set(LENTICULE_SYSTEM_FOLDER /etc/lenticule)
endif()
# "lib" instead of the multiarch folder: systemd and udev search there, in /usr and in /usr/local.
set(LENTICULE_UNIT_DIR lib/systemd/system CACHE PATH "Folder of systemd's units")
set(LENTICULE_SYSUSERS_DIR lib/sysusers.d CACHE PATH "Folder of systemd's users")
set(LENTICULE_TMPFILES_DIR lib/tmpfiles.d CACHE PATH "Folder of systemd's folders to be made")
set(LENTICULE_UDEV_DIR lib/udev/rules.d CACHE PATH "Folder of udev's rules")

# Loadable modules are found by name in the run path of the program that loads them, helper programs relative to
# the program that starts them (base/installation.h): an installed tree can be moved.
set(LENTICULE_MODULE_FOLDER ${PROJECT_BINARY_DIR}/modules)
set(LENTICULE_INSTALL_MODULE_FOLDER ${CMAKE_INSTALL_LIBDIR}/lenticule)
set(helpers ${CMAKE_INSTALL_FULL_LIBEXECDIR}/lenticule)
set(modules ${CMAKE_INSTALL_FULL_LIBDIR}/lenticule)
file(RELATIVE_PATH LENTICULE_HELPERS_FROM_PROGRAMS ${CMAKE_INSTALL_FULL_BINDIR} ${helpers})
file(RELATIVE_PATH LENTICULE_PROGRAMS_FROM_HELPERS ${helpers} ${CMAKE_INSTALL_FULL_BINDIR})
file(RELATIVE_PATH modules_from_programs ${CMAKE_INSTALL_FULL_BINDIR} ${modules})
file(RELATIVE_PATH modules_from_helpers ${helpers} ${modules})
set(CMAKE_BUILD_RPATH ${LENTICULE_MODULE_FOLDER})
set(CMAKE_INSTALL_RPATH $ORIGIN/${modules_from_programs})
set(LENTICULE_HELPER_RPATH $ORIGIN/${modules_from_helpers})
