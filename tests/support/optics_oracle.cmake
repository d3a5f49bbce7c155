# SPDX-License-Identifier: Apache-2.0
# The slow optical model and random rigs for the tests of every module that uses optics.
add_library(lenticule_optics_oracle STATIC
  ${CMAKE_CURRENT_LIST_DIR}/optics_oracle.cpp
  ${CMAKE_CURRENT_LIST_DIR}/random_rigs.cpp
  ${CMAKE_CURRENT_LIST_DIR}/zone_oracle.cpp)
target_link_libraries(lenticule_optics_oracle PUBLIC lenticule_options lenticule::optics)
