# SPDX-License-Identifier: Apache-2.0
# Slow references of metallic-roughness shading and of the ground shadow.
add_library(lenticule_pbr_oracle STATIC ${CMAKE_CURRENT_LIST_DIR}/pbr_oracle.cpp
  ${CMAKE_CURRENT_LIST_DIR}/ground_shadow_oracle.cpp)
target_link_libraries(lenticule_pbr_oracle PUBLIC lenticule_options lenticule::render)
