# SPDX-License-Identifier: Apache-2.0
# A fake libdrm, compiled once. Its objects are part of the test program and so replace the functions of
# the library; --as-needed drops the library if the fake is complete.
add_library(lenticule_fake_drm OBJECT
  ${CMAKE_CURRENT_LIST_DIR}/fake_drm.cpp
  ${CMAKE_CURRENT_LIST_DIR}/fake_drm_card.cpp
  ${CMAKE_CURRENT_LIST_DIR}/fake_drm_calls.cpp
  ${CMAKE_CURRENT_LIST_DIR}/fake_drm_objects.cpp)
target_link_options(lenticule_fake_drm INTERFACE LINKER:--as-needed)
target_link_libraries(lenticule_fake_drm PUBLIC lenticule_options lenticule::display PkgConfig::LIBDRM)
