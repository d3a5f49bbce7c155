# SPDX-License-Identifier: Apache-2.0
add_library(lenticule_picture_oracle STATIC ${CMAKE_CURRENT_LIST_DIR}/picture_oracle.cpp
  ${CMAKE_CURRENT_LIST_DIR}/flip_oracle.cpp)
target_link_libraries(lenticule_picture_oracle PUBLIC lenticule_options lenticule::frames)
