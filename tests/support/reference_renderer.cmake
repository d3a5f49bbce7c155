# SPDX-License-Identifier: Apache-2.0
# The renderer's slow reference implementation: no Embree, no packets, no code of render/ but the
# plain scene description.
add_library(lenticule_reference_renderer STATIC
  ${CMAKE_CURRENT_LIST_DIR}/reference_renderer.cpp
  ${CMAKE_CURRENT_LIST_DIR}/reference_sampling.cpp
  ${CMAKE_CURRENT_LIST_DIR}/tiny_scenes.cpp)
target_link_libraries(lenticule_reference_renderer PUBLIC lenticule_options lenticule::render)
