# SPDX-License-Identifier: Apache-2.0
add_library(lenticule_depth_oracle STATIC ${CMAKE_CURRENT_LIST_DIR}/depth_oracle.cpp)
target_link_libraries(lenticule_depth_oracle PUBLIC lenticule_options lenticule::frames)
