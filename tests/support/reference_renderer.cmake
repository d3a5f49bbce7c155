# SPDX-License-Identifier: Apache-2.0
# The slow oracle of the renderer: no Embree, no packets, no shared code with render/ beyond the
# plain scene description.
add_library(lenticule_reference_renderer STATIC
  ${CMAKE_CURRENT_LIST_DIR}/reference_renderer.cpp
  ${CMAKE_CURRENT_LIST_DIR}/reference_sampling.cpp
  ${CMAKE_CURRENT_LIST_DIR}/tiny_scenes.cpp)
target_link_libraries(lenticule_reference_renderer PUBLIC lenticule_options lenticule::render)
