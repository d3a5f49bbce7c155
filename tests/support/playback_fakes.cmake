# SPDX-License-Identifier: Apache-2.0
# A scripted source and a recorder that keeps displayed frames, for display and player tests.
add_library(lenticule_playback_fakes STATIC ${CMAKE_CURRENT_LIST_DIR}/fake_source.cpp)
target_link_libraries(lenticule_playback_fakes PUBLIC
  lenticule_options lenticule::frames lenticule::display
  PRIVATE PkgConfig::XXHASH)
