# SPDX-License-Identifier: Apache-2.0
# Reference implementation of re-projection between lenses, subpixel by subpixel.
add_library(lenticule_reprojection_oracle STATIC ${CMAKE_CURRENT_LIST_DIR}/reprojection_oracle.cpp)
target_link_libraries(lenticule_reprojection_oracle PUBLIC lenticule_options lenticule::optics)
